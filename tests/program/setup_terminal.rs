//! `slamd setup` on a pseudo-terminal: it asks, guides, and writes only what is agreed to.

#![allow(clippy::unwrap_used, reason = "a test may")]

use crate::monitor_terminal::Watched;

#[test]
fn it_asks_guides_and_writes_only_with_consent() {
    let folder = tempfile::tempdir().unwrap();
    let board = folder.path().join("board");
    let _simulated = crate::setup::Board::new(folder.path(), &["--sensors", "16", "--duration", "900"]);
    let robot = folder.path().join("robot.toml");
    let arguments = ["setup", "--port", board.to_str().unwrap(), "--out", robot.to_str().unwrap()];
    for (answer, code) in [("n\n", 75), ("\n", 0)] {
        let mut setup = Watched::run(&arguments);
        setup.expect_text("Diameter of a wheel, mm (Enter if unknown): ");
        setup.press("70\n");
        setup.expect_text("Distance between the wheels, mm (Enter if unknown): ");
        setup.press("\n");
        setup.expect_text("now drive it around the room");
        setup.expect_text("[Y/n] ");
        assert!(setup.text().contains("wheel_radius_m = 0.035"), "{}", setup.text());
        setup.press(answer);
        assert_eq!(setup.end().code(), Some(code), "{}", setup.text());
        assert_eq!(robot.exists(), code == 0, "{}", setup.text());
    }
    let written = std::fs::read_to_string(&robot).unwrap();
    assert!(written.contains("wheel_radius_m = 0.035") && written.contains("count = 16"), "{written}");
}
