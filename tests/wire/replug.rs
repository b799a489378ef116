//! A hundred times unplugged and replugged; `cargo xtask replug` does it a thousand times.

use slamd_testkit::mock_port;

#[test]
fn a_hundred_replugs_are_survived() {
    let measured = mock_port::replug::replug(100, || ());
    println!("{measured:?}");
    measured.check();
}
