//! `map.png`: the map, the path over it, the robot with its good and bad sensors, a scale bar and a legend.

mod canvas;
mod floor;
mod legend;
mod robot;

use canvas::{Canvas, Ink, Pen};
use floor::Floor;
use robot::RobotMark;
use slamd_core::{Point, Pose2, Raster, Ring, SensorState};

/// What the picture shows. All paths are in the map frame, metres.
pub(super) struct Scene<'a> {
    pub(super) raster: &'a Raster,
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
    let shown = scene.path.iter().flat_map(|stretch| &stretch.points).chain(scene.truth).copied();
    let floor = Floor::new(scene.raster, shown);
    let (width, height) = floor.size();
    let canvas_width = width.max(legend::MIN_WIDTH_PX) + 2 * FRAME_PX;
    let below_px = legend::HEIGHT_PX + legend::doubts_height_px(scene.doubts, canvas_width);
    let mut canvas = Canvas::new(canvas_width, height + 2 * FRAME_PX + below_px, PAPER);
    let corner = ((canvas_width - width) / 2, FRAME_PX);

    floor.paint(&mut canvas, corner);
    canvas.within(corner, (width, height), |plan| {
        draw_paths(plan, &floor, scene);
        draw_robot(plan, &floor, scene);
    });

    let top = (FRAME_PX + height + FRAME_PX / 2) as f64;
    legend::draw(&mut canvas, top, scene, &floor);
    legend::draw_doubts(&mut canvas, top + legend::HEIGHT_PX as f64, scene.doubts);
    canvas.into_png()
}

/// A sheet that shows no map but says why there is none.
///
/// # Errors
/// As [`draw`].
pub(super) fn draw_reason(scene: &Scene<'_>, reason: &str) -> std::io::Result<Vec<u8>> {
    let width = legend::MIN_WIDTH_PX + 2 * FRAME_PX;
    let texts = [&[format!("nothing mapped: {reason}")], scene.doubts].concat();
    let height = legend::HEIGHT_PX + legend::doubts_height_px(&texts, width) + FRAME_PX;
    let mut canvas = Canvas::new(width, height, PAPER);
    legend::draw_robot(&mut canvas, 0.0, scene);
    legend::draw_doubts(&mut canvas, legend::HEIGHT_PX as f64, &texts);
    canvas.into_png()
}

fn draw_paths(canvas: &mut Canvas, floor: &Floor<'_>, scene: &Scene<'_>) {
    let pixels = |points: &[Point]| points.iter().map(|&point| floor.pixel(point)).collect::<Vec<_>>();
    canvas.polyline(pixels(scene.odometry), ODOMETRY);
    for (certain, uncertain) in [(HALO, HALO), (PATH, UNCERTAIN)] {
        for Stretch { is_uncertain, points } in scene.path {
            canvas.polyline(pixels(points), if *is_uncertain { uncertain } else { certain });
        }
    }
    canvas.polyline(pixels(scene.truth), TRUTH);
    if let Some(&start) = scene.path.first().and_then(|stretch| stretch.points.first()) {
        draw_start(canvas, floor.pixel(start));
    }
}

fn draw_start(canvas: &mut Canvas, at: canvas::Pixel) {
    canvas.disc(at, 7.0, [255, 255, 255, 255]);
    canvas.circle(at, 6.5, Pen::solid(PATH.ink, 3.0));
}

fn draw_robot(canvas: &mut Canvas, floor: &Floor<'_>, scene: &Scene<'_>) {
    let scale = floor.scale_px_m();
    let mark = RobotMark {
        ring: scene.ring,
        states: scene.states,
        body_px: (robot::body_m(scene.ring) * scale).max(8.0),
        beam_px: (BEAM_M * scale).clamp(14.0, 40.0),
    };
    mark.draw(canvas, floor.pixel(scene.pose.position()), scene.pose.theta_rad);
}

/// Empty paper round the floor, pixels.
const FRAME_PX: usize = 24;
/// Length of the beams round the robot on the floor, metres.
const BEAM_M: f64 = 0.3;

const PAPER: Ink = [247, 247, 245, 255];
const PATH: Pen = Pen::solid([38, 118, 204, 255], 3.0);
const UNCERTAIN: Pen = Pen { ink: PATH.ink, width_px: 2.2, dash_px: Some((5.0, 9.0)) };
const HALO: Pen = Pen::solid([255, 255, 255, 190], 6.5);
const ODOMETRY: Pen = Pen::solid([224, 140, 52, 120], 1.6);
const TRUTH: Pen = Pen { ink: [24, 24, 32, 220], width_px: 1.3, dash_px: Some((5.0, 5.0)) };

#[cfg(test)]
mod tests;
