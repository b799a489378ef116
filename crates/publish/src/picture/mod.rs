//! `map.png` and `map.svg`: the floor plan, the path over it, the robot with its good and bad sensors, a scale bar and a legend.

mod canvas;
mod drive;
mod floor;
mod labels;
mod legend;
mod robot;
mod surface;
mod svg;

pub(super) use drive::Drive;

use crate::plan::Plan;
use canvas::Canvas;
use floor::Floor;
use robot::RobotMark;
use slamd_core::{Point, Pose2, Raster, Ring, SensorState};
use surface::{Ink, Pen, Pixel, Surface};
use svg::Svg;

/// What the picture shows. All paths are in the map frame, metres.
pub(super) struct Scene<'a> {
    pub(super) raster: &'a Raster,
    pub(super) plan: &'a Plan,
    pub(super) drive: Drive,
    /// The path, cut where it becomes uncertain or certain.
    pub(super) path: &'a [Stretch],
    /// The length of the whole path, metres.
    pub(super) path_m: f64,
    /// The path by the encoders alone, moved so that it begins where the path begins.
    pub(super) odometry: &'a [Point],
    /// The true path; empty where it is unknown.
    pub(super) truth: &'a [Point],
    /// Root mean square distance from the truth, metres.
    pub(super) ate_m: Option<f64>,
    /// Where the robot is at the end.
    pub(super) pose: Pose2,
    pub(super) ring: &'a Ring,
    pub(super) states: &'a [SensorState],
    pub(super) robot_name: &'a str,
    /// What is doubtful, one sentence each.
    pub(super) doubts: &'a [String],
}

/// A part of the path, all of it certain or all of it uncertain.
pub(super) struct Stretch {
    pub(super) is_uncertain: bool,
    pub(super) points: Vec<Point>,
}

/// Draws the scene as a PNG file.
///
/// # Errors
/// Where the picture is too large for the format.
pub(super) fn draw(scene: &Scene<'_>) -> std::io::Result<Vec<u8>> {
    let sheet = Sheet::new(scene);
    let mut canvas = Canvas::new(sheet.size.0, sheet.size.1, PAPER);
    sheet.draw(&mut canvas, scene);
    canvas.into_png()
}

/// Draws the scene as an SVG file.
pub(super) fn draw_svg(scene: &Scene<'_>) -> String {
    let sheet = Sheet::new(scene);
    let title = format!("{}, 1:{:.0} on paper", scene.robot_name, sheet.reduction());
    let pixel_mm = 1000.0 / (sheet.floor.scale_px_m() * sheet.reduction());
    let mut svg = Svg::new(sheet.size.0, sheet.size.1, pixel_mm, &title, PAPER);
    sheet.draw(&mut svg, scene);
    svg.into_text()
}

/// The layout of a picture.
struct Sheet<'a> {
    floor: Floor<'a>,
    size: (usize, usize),
}

impl<'a> Sheet<'a> {
    fn new(scene: &Scene<'a>) -> Self {
        let shown = scene.path.iter().flat_map(|stretch| &stretch.points).chain(scene.truth).copied();
        let floor = Floor::new(scene.raster, shown);
        let (width, height) = floor.size();
        let width = width.max(legend::MIN_WIDTH_PX) + 2 * FRAME_PX;
        let below_px = legend::HEIGHT_PX + legend::doubts_height_px(scene.doubts, width);
        Self { floor, size: (width, height + 2 * FRAME_PX + below_px) }
    }

    /// Metres of the floor per metre of paper: the least of an architect's scales with which the picture fits on A4.
    fn reduction(&self) -> f64 {
        let long_m = self.size.0.max(self.size.1) as f64 / self.floor.scale_px_m();
        REDUCTIONS.into_iter().find(|reduction| long_m <= A4_M * reduction).unwrap_or(10_000.0)
    }

    fn draw(&self, canvas: &mut dyn Surface, scene: &Scene<'_>) {
        let (width, height) = self.floor.size();
        let corner = ((self.size.0 - width) / 2, FRAME_PX);
        canvas.within(corner, (width, height), &mut |plan| {
            plan.layer("floor");
            self.floor.paint(plan, scene.plan, (0, 0));
            plan.layer("gaps");
            for gap in &scene.plan.gaps {
                plan.polyline(&gap.map(|point| self.floor.pixel(point)), GAP);
            }
            draw_paths(plan, &self.floor, scene);
            plan.layer("robot");
            draw_robot(plan, &self.floor, scene);
            plan.layer("measures");
            labels::draw(plan, &self.floor, scene.plan, &mut self.drawn(scene));
        });
        let top = (FRAME_PX + height + FRAME_PX / 2) as f64;
        canvas.layer("legend");
        legend::draw(canvas, top, scene, &self.floor);
        legend::draw_doubts(canvas, top + legend::HEIGHT_PX as f64, scene.doubts);
    }
}

impl Sheet<'_> {
    /// What stands in the way of labels: the path, its start and the robot.
    fn drawn(&self, scene: &Scene<'_>) -> labels::Drawn {
        let pixel = |point: &Point| self.floor.pixel(*point);
        let paths: Vec<Vec<Pixel>> =
            scene.path.iter().map(|stretch| stretch.points.iter().map(pixel).collect()).collect();
        let start = paths.first().and_then(|path| path.first()).map(|start| (*start, 9.0));
        let mark = robot_mark(&self.floor, scene);
        let robot = (self.floor.pixel(scene.pose.position()), mark.body_px + mark.beam_px);
        let circles: Vec<(Pixel, f64)> = start.into_iter().chain([robot]).collect();
        labels::Drawn::new(paths.iter().map(Vec::as_slice), &circles)
    }
}

/// A sheet that shows no map but says why there is none.
///
/// # Errors
/// As [`draw`].
pub(super) fn draw_reason(scene: &Scene<'_>, reason: &str) -> std::io::Result<Vec<u8>> {
    let (texts, (width, height)) = reason_sheet(scene, reason);
    let mut canvas = Canvas::new(width, height, PAPER);
    draw_reason_on(&mut canvas, scene, &texts);
    canvas.into_png()
}

/// The same as SVG.
pub(super) fn draw_reason_svg(scene: &Scene<'_>, reason: &str) -> String {
    let (texts, (width, height)) = reason_sheet(scene, reason);
    let mut svg = Svg::new(width, height, REASON_PIXEL_MM, scene.robot_name, PAPER);
    draw_reason_on(&mut svg, scene, &texts);
    svg.into_text()
}

/// The sentences on a sheet without a map, and its size.
fn reason_sheet(scene: &Scene<'_>, reason: &str) -> (Vec<String>, (usize, usize)) {
    let width = legend::MIN_WIDTH_PX + 2 * FRAME_PX;
    let texts = [&[format!("nothing mapped: {reason}")], scene.doubts].concat();
    let height = legend::ROBOT_HEIGHT_PX + legend::doubts_height_px(&texts, width) + FRAME_PX;
    (texts, (width, height))
}

fn draw_reason_on(canvas: &mut dyn Surface, scene: &Scene<'_>, texts: &[String]) {
    legend::draw_robot(canvas, 0.0, scene);
    legend::draw_doubts(canvas, legend::ROBOT_HEIGHT_PX as f64, texts);
}

fn draw_paths(canvas: &mut dyn Surface, floor: &Floor<'_>, scene: &Scene<'_>) {
    let pixels = |points: &[Point]| points.iter().map(|&point| floor.pixel(point)).collect::<Vec<_>>();
    if !scene.truth.is_empty() {
        // Only a drive whose truth is known is a test of the encoders.
        canvas.layer("encoders");
        canvas.polyline(&pixels(scene.odometry), ODOMETRY);
    }
    canvas.layer("path");
    for (certain, uncertain) in [(HALO, HALO), (PATH, UNCERTAIN)] {
        for Stretch { is_uncertain, points } in scene.path {
            canvas.polyline(&pixels(points), if *is_uncertain { uncertain } else { certain });
        }
    }
    canvas.polyline(&pixels(scene.truth), TRUTH);
    if let Some(&start) = scene.path.first().and_then(|stretch| stretch.points.first()) {
        draw_start(canvas, floor.pixel(start));
    }
}

fn draw_start(canvas: &mut dyn Surface, at: Pixel) {
    canvas.disc(at, 7.0, [255, 255, 255, 255]);
    canvas.circle(at, 6.5, Pen::solid(PATH.ink, 3.0));
}

fn draw_robot(canvas: &mut dyn Surface, floor: &Floor<'_>, scene: &Scene<'_>) {
    let mark = robot_mark(floor, scene);
    mark.draw(canvas, floor.pixel(scene.pose.position()), scene.pose.theta_rad);
}

fn robot_mark<'a>(floor: &Floor<'_>, scene: &Scene<'a>) -> RobotMark<'a> {
    let scale = floor.scale_px_m();
    RobotMark {
        ring: scene.ring,
        states: scene.states,
        body_px: (robot::body_m(scene.ring) * scale).max(8.0),
        beam_px: (BEAM_M * scale).clamp(14.0, 40.0),
    }
}

const REDUCTIONS: [f64; 6] = [20.0, 50.0, 100.0, 200.0, 500.0, 1000.0];
/// The long side of an A4 sheet without its margins.
const A4_M: f64 = 0.277;
/// A sheet without a map is 20 cm wide.
const REASON_PIXEL_MM: f64 = 0.19;
/// Empty paper round the floor, pixels.
const FRAME_PX: usize = 24;
/// Length of the beams round the robot on the floor, metres.
const BEAM_M: f64 = 0.3;

const PAPER: Ink = [247, 247, 245, 255];
const PATH: Pen = Pen::solid([38, 118, 204, 255], 3.0);
const UNCERTAIN: Pen = Pen { ink: PATH.ink, width_px: 2.2, dash_px: Some((5.0, 9.0)) };
const HALO: Pen = Pen::solid([255, 255, 255, 190], 6.5);
const ODOMETRY: Pen = Pen::solid([224, 140, 52, 120], 1.6);
const GAP: Pen = Pen { ink: [112, 118, 130, 255], width_px: 1.5, dash_px: Some((3.0, 5.0)) };
const TRUTH: Pen = Pen { ink: [24, 24, 32, 220], width_px: 1.3, dash_px: Some((5.0, 5.0)) };

#[cfg(test)]
mod tests;
