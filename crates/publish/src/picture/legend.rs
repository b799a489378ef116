//! The strip below the map: the ring of sensors enlarged, what the lines mean, how long a metre is, and what is known of the drive.

use super::floor::{Floor, OUTSIDE};
use super::robot::{FAULTY, HEALTHY, RobotMark};
use super::surface::{Direction, Ink, Pen, Surface, TEXT_PX, text_width_px};
use super::{GAP, ODOMETRY, PATH, Scene, TRUTH, UNCERTAIN, draw_start};
use slamd_core::SensorState;
use std::f64::consts::FRAC_PI_2;

/// Height of the strip, pixels.
pub(super) const HEIGHT_PX: usize = 214;
/// Height of its first part, the robot, pixels.
pub(super) const ROBOT_HEIGHT_PX: usize = 150;
/// The strip needs this width, pixels.
pub(super) const MIN_WIDTH_PX: usize = 1000;

/// Draws the strip from `top` down.
pub(super) fn draw(canvas: &mut dyn Surface, top: f64, scene: &Scene<'_>, floor: &Floor<'_>) {
    draw_robot(canvas, top, scene);
    let mut line = LegendEntry { canvas, x: LEFT_PX, y: top + 10.0 };
    line.next();
    draw_path_entries(&mut line, scene);
    line.next();
    draw_floor_entries(&mut line, scene);
    line.next();
    line.axes();
    line.words("axes of the map; no compass, north is unknown", FAINT);
    line.scale_bar(floor.scale_px_m());
    line.next();
    line.words(&scene.drive.when(), TEXT);
    line.words(&scene.drive.certainty(), FAINT);
}

fn draw_path_entries(line: &mut LegendEntry<'_>, scene: &Scene<'_>) {
    line.stroke(PATH);
    line.words(&format!("path, {:.1} m", scene.path_m), TEXT);
    if scene.path.iter().any(|stretch| stretch.is_uncertain) {
        line.stroke(UNCERTAIN);
        line.words("uncertain", TEXT);
    }
    line.start();
    line.words("start", TEXT);
    if !scene.truth.is_empty() {
        line.stroke(ODOMETRY);
        line.words("encoders alone", TEXT);
        line.stroke(TRUTH);
        let error = scene.ate_m.map_or(String::new(), |ate_m| format!(", {:.0} cm off (RMS)", ate_m * 100.0));
        line.words(&format!("truth{error}"), TEXT);
    }
}

fn draw_floor_entries(line: &mut LegendEntry<'_>, scene: &Scene<'_>) {
    let plan = scene.plan;
    let rooms = match plan.rooms.len() {
        0 => "no room is closed by walls".into(),
        1 => format!("{:.1} m2 of floor in 1 room", plan.floor_m2()),
        many => format!("{:.1} m2 of floor in {many} rooms", plan.floor_m2()),
    };
    line.words(&rooms, TEXT);
    if !plan.gaps.is_empty() {
        line.stroke(GAP);
        line.words("gap, not driven through", FAINT);
    }
    if !plan.rooms.is_empty() {
        line.swatch(OUTSIDE);
        line.words(&format!("{:.1} m2 seen from afar only", plan.afar_m2), FAINT);
    }
}

/// Draws the ring of sensors, and the line with its name and state.
pub(super) fn draw_robot(canvas: &mut dyn Surface, top: f64, scene: &Scene<'_>) {
    let dial = RobotMark { ring: scene.ring, states: scene.states, body_px: 20.0, beam_px: 42.0 };
    dial.draw(canvas, (MARGIN_PX + 66.0, top + 72.0), FRAC_PI_2);
    let mut line = LegendEntry { canvas, x: LEFT_PX, y: top + 10.0 };
    line.words(scene.robot_name, TEXT);
    line.words(&format!("{} sensors", scene.ring.len()), FAINT);
    let (words, ink) = verdict(scene.states);
    line.words(&words, ink);
}

/// The height of what [`draw_doubts`] writes on a picture of this width, pixels.
pub(super) fn doubts_height_px(doubts: &[String], width_px: usize) -> usize {
    LINE_PX * wrapped(doubts, width_px as f64).len()
}

/// Writes the sentences below the legend, each from a new line.
pub(super) fn draw_doubts(canvas: &mut dyn Surface, top: f64, doubts: &[String]) {
    for (index, line) in wrapped(doubts, canvas.width_px()).iter().enumerate() {
        canvas.text((MARGIN_PX, top + (LINE_PX * index) as f64), line, FAULTY, Direction::Right);
    }
}

/// Lines that fit between the margins.
fn wrapped(sentences: &[String], width_px: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for sentence in sentences {
        let mut line = String::from("!");
        for word in sentence.split_whitespace() {
            if text_width_px(&line) + text_width_px(word) > width_px - 3.0 * MARGIN_PX {
                lines.push(std::mem::replace(&mut line, " ".into()));
            }
            line += " ";
            line += word;
        }
        lines.push(line);
    }
    lines.truncate(MAX_LINES);
    lines
}

/// A line of words and samples, written from left to right.
struct LegendEntry<'a> {
    canvas: &'a mut dyn Surface,
    x: f64,
    y: f64,
}

impl LegendEntry<'_> {
    fn words(&mut self, words: &str, ink: Ink) {
        let room_px = self.canvas.width_px() - MARGIN_PX - self.x;
        let mut shown = words.to_owned();
        while text_width_px(&shown) > room_px && shown.len() > 3 {
            shown = shown.trim_end_matches("...").into();
            shown.pop();
            shown += "...";
        }
        self.canvas.text((self.x, self.y), &shown, ink, Direction::Right);
        self.x += text_width_px(&shown) + GAP_PX;
    }

    fn stroke(&mut self, pen: Pen) {
        let y = self.y + TEXT_PX / 2.0;
        self.canvas.polyline(&[(self.x, y), (self.x + SAMPLE_PX, y)], pen);
        self.x += SAMPLE_PX + 9.0;
    }

    fn start(&mut self) {
        draw_start(self.canvas, (self.x + 7.0, self.y + TEXT_PX / 2.0));
        self.x += 14.0 + 9.0;
    }

    /// The shortest round length that is long enough to be seen.
    fn scale_bar(&mut self, scale_px_m: f64) {
        let lengths_m = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
        let length_m = lengths_m.into_iter().find(|length_m| length_m * scale_px_m >= 40.0).unwrap_or(200.0);
        let (x0, x1, y) = (self.x, self.x + length_m * scale_px_m, self.y + TEXT_PX / 2.0);
        let pen = Pen::solid(TEXT, 2.0);
        self.canvas.polyline(&[(x0, y - 5.0), (x0, y + 5.0)], pen);
        self.canvas.polyline(&[(x1, y - 5.0), (x1, y + 5.0)], pen);
        self.canvas.polyline(&[(x0, y), (x1, y)], pen);
        self.x = x1 + 9.0;
        self.words(&format!("{length_m} m"), TEXT);
    }

    /// Arrows along x and y.
    fn axes(&mut self) {
        let (x, y, pen) = (self.x + 2.0, self.y + TEXT_PX + 2.0, Pen::solid(TEXT, 2.0));
        for (dx, dy) in [(1.0, 0.0), (0.0, 1.0)] {
            // A point so far along the axis and so far to its side.
            let at = |along: f64, side: f64| (x + along * dx + side * dy, y - along * dy - side * dx);
            self.canvas.polyline(&[at(0.0, 0.0), at(AXIS_PX, 0.0)], pen);
            self.canvas.polyline(&[at(AXIS_PX - 5.0, 4.0), at(AXIS_PX, 0.0), at(AXIS_PX - 5.0, -4.0)], pen);
        }
        self.canvas.text((x + AXIS_PX + 4.0, y - 14.0), "x", TEXT, Direction::Right);
        self.canvas.text((x + 7.0, y - AXIS_PX - 6.0), "y", TEXT, Direction::Right);
        self.x += AXIS_PX + 28.0;
    }

    fn swatch(&mut self, ink: Ink) {
        let (x, y) = (self.x, self.y + 2.0);
        let corners = [(x, y), (x + SAMPLE_PX, y), (x + SAMPLE_PX, y + 16.0), (x, y + 16.0)];
        self.canvas.polygon(&corners, ink);
        let [a, b, c, d] = corners;
        self.canvas.polyline(&[a, b, c, d, a], Pen::solid(FAINT, 1.0));
        self.x += SAMPLE_PX + 9.0;
    }

    fn next(&mut self) {
        (self.x, self.y) = (LEFT_PX, self.y + ROW_PX);
    }
}

fn verdict(states: &[SensorState]) -> (String, Ink) {
    let faulty: Vec<String> = states
        .iter()
        .enumerate()
        .filter_map(|(sensor, state)| match state {
            SensorState::Healthy => None,
            SensorState::Faulty(kind) => Some(format!("{sensor} {}", kind.word())),
        })
        .collect();
    if faulty.is_empty() { ("all healthy".into(), HEALTHY) } else { (format!("x {}", faulty.join(", ")), FAULTY) }
}

const MARGIN_PX: f64 = 24.0;
/// Where the words begin, right of the ring, pixels.
const LEFT_PX: f64 = MARGIN_PX + 156.0;
/// From one sentence to the next, pixels.
const LINE_PX: usize = 26;
/// A picture has no room for more.
const MAX_LINES: usize = 12;
/// From one line of the legend to the next, pixels.
const ROW_PX: f64 = 39.0;
const AXIS_PX: f64 = 24.0;
const SAMPLE_PX: f64 = 34.0;
const GAP_PX: f64 = 26.0;
const TEXT: Ink = [40, 44, 54, 255];
const FAINT: Ink = [112, 118, 130, 255];
