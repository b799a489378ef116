//! Converts poses, beams and walls into Rerun's archetypes.

use super::chart::Picture;
use super::snapshot::Beam;
use super::style::{self, Rgba, colour};
use nalgebra::Matrix3;
use rerun::{Color, GridMap, LineStrips3D, Mesh3D, Points3D, Radius, Transform3D};
use slamd_core::{Pose2, Segment};
use std::f32::consts::TAU;

/// Heights above the map, metres. They order the layers in the view from above.
const WALL_M: f32 = 0.004;
const BODY_M: f32 = 0.02;
const CONE_M: f32 = 0.016;
const ECHO_M: f32 = 0.03;
const ELLIPSE_M: f32 = 0.025;
/// Radius that holds 95 % of a two-dimensional normal distribution, standard deviations.
const ELLIPSE_SIGMA: f64 = 2.447_7;

/// The pose of a frame in its parent frame.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "for display")]
pub(super) fn transform(pose: Pose2) -> Transform3D {
    let turn = rerun::RotationAxisAngle::new([0.0, 0.0, 1.0], rerun::Angle::from_radians(pose.theta_rad as f32));
    Transform3D::from_translation_rotation([pose.x_m as f32, pose.y_m as f32, 0.0], turn)
}

/// The map.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "for display")]
pub(super) fn grid(picture: Picture) -> GridMap {
    use rerun::datatypes::{ChannelDatatype, ColorModel};
    let size = [picture.width, picture.height];
    let format = rerun::components::ImageFormat::from_color_model(size, ColorModel::L, ChannelDatatype::U8);
    let [x_m, y_m] = picture.corner_m;
    GridMap::new(picture.cells, format, picture.cell_m as f32)
        .with_translation([x_m as f32, y_m as f32, 0.0])
        .with_colormap(rerun::components::Colormap::RvizMap)
}

/// The robot: a disc with an arrow that points forward.
#[must_use]
pub(super) fn robot(radius_m: f32, rgba: Rgba) -> Mesh3D {
    const CORNERS: u16 = 48;
    let rim = |corner: u16| {
        let (sin, cos) = libm::sincosf(TAU * f32::from(corner) / f32::from(CORNERS));
        [radius_m * cos, radius_m * sin, BODY_M]
    };
    let mut positions: Vec<[f32; 3]> = vec![[0.0, 0.0, BODY_M]];
    positions.extend((0..CORNERS).map(rim));
    let mut triangles: Vec<[u32; 3]> =
        (0..CORNERS).map(|corner| [0, u32::from(corner) + 1, u32::from((corner + 1) % CORNERS) + 1]).collect();
    let mut colours = vec![colour(rgba); positions.len()];
    let arrow = u32::from(CORNERS) + 1;
    let top_m = BODY_M + 0.002;
    positions.extend([
        [0.75 * radius_m, 0.0, top_m],
        [-0.45 * radius_m, 0.5 * radius_m, top_m],
        [-0.2 * radius_m, 0.0, top_m],
        [-0.45 * radius_m, -0.5 * radius_m, top_m],
    ]);
    triangles.extend([[arrow, arrow + 1, arrow + 2], [arrow, arrow + 2, arrow + 3]]);
    colours.extend([colour([255, 255, 255, 255]); 4]);
    Mesh3D::new(positions).with_triangle_indices(triangles).with_vertex_colors(colours)
}

/// The cone of each beam up to its range. Beams without a return are not drawn.
#[must_use]
pub(super) fn cones(beams: &[Beam]) -> LineStrips3D {
    let drawn = beams.iter().filter(|beam| beam.range_m.is_finite());
    let strips: Vec<Vec<[f32; 3]>> = drawn.clone().map(cone).collect();
    let colours: Vec<Color> = drawn.map(|beam| faint(style::verdict(beam.verdict))).collect();
    LineStrips3D::new(strips).with_colors(colours).with_radii([Radius::new_ui_points(0.75)])
}

#[expect(clippy::cast_possible_truncation, reason = "for display")]
fn cone(beam: &Beam) -> Vec<[f32; 3]> {
    const STEPS: i16 = 4;
    let sensor = beam.robot_from_sensor;
    let at = |range_m: f32, off_rad: f32| {
        let pose = Pose2::new(sensor.x_m, sensor.y_m, sensor.theta_rad + f64::from(off_rad));
        let point = pose.ahead(f64::from(range_m));
        [point.x as f32, point.y as f32, CONE_M]
    };
    let rim = (-STEPS..=STEPS).map(|step| f32::from(step) / f32::from(STEPS) * beam.half_angle_rad);
    let apex = at(0.0, 0.0);
    [apex].into_iter().chain(rim.map(|off_rad| at(beam.range_m, off_rad))).chain([apex]).collect()
}

fn faint([r, g, b, _]: Rgba) -> Color {
    Color::from_unmultiplied_rgba(r, g, b, 110)
}

/// The return of each beam, in the colour of its verdict.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "for display")]
pub(super) fn echoes(beams: &[Beam]) -> Points3D {
    let returns = beams.iter().filter(|beam| beam.range_m.is_finite());
    let point = |beam: &Beam| {
        let point = beam.robot_from_sensor.ahead(f64::from(beam.range_m));
        [point.x as f32, point.y as f32, ECHO_M]
    };
    let positions: Vec<[f32; 3]> = returns.clone().map(point).collect();
    let colours: Vec<Color> = returns.map(|beam| colour(style::verdict(beam.verdict))).collect();
    Points3D::new(positions).with_colors(colours).with_radii([Radius::new_ui_points(3.5)])
}

/// Each sensor on the ring, in the colour of its state and with its number.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "for display")]
pub(super) fn sensors(beams: &[Beam]) -> Points3D {
    let point = |beam: &Beam| {
        let position = beam.robot_from_sensor.position();
        [position.x as f32, position.y as f32, ECHO_M]
    };
    let labels: Vec<String> = (0..beams.len()).map(|sensor| sensor.to_string()).collect();
    Points3D::new(beams.iter().map(point).collect::<Vec<_>>())
        .with_colors(beams.iter().map(|beam| colour(style::state(beam.state))).collect::<Vec<_>>())
        .with_radii([Radius::new_ui_points(3.0)])
        .with_labels(labels)
        .with_show_labels(false)
}

/// Walls as lines.
#[must_use]
pub(super) fn walls(segments: &[Segment]) -> LineStrips3D {
    let strips: Vec<_> =
        segments.iter().map(|segment| [(segment.from, 0.0), (segment.to, 0.0)].map(at(segment))).collect();
    LineStrips3D::new(strips).with_colors([colour(style::WALL)]).with_radii([Radius::new_ui_points(1.25)])
}

/// The band that holds each wall with a probability of 95 %.
#[must_use]
pub(super) fn wall_bands(segments: &[Segment]) -> LineStrips3D {
    let known = segments.iter().filter(|segment| segment.sigma_m > 0.0);
    let strips: Vec<_> = known
        .map(|segment| {
            let off_m = 2.0 * segment.sigma_m;
            let corners = [
                (segment.from, off_m),
                (segment.to, off_m),
                (segment.to, -off_m),
                (segment.from, -off_m),
                (segment.from, off_m),
            ];
            corners.map(at(segment))
        })
        .collect();
    LineStrips3D::new(strips).with_colors([faint(style::WALL)]).with_radii([Radius::new_ui_points(0.75)])
}

/// Shifts points of a wall across it, metres.
#[expect(clippy::cast_possible_truncation, reason = "for display")]
fn at(segment: &Segment) -> impl Fn((slamd_core::Point, f64)) -> [f32; 3] {
    let along = (segment.to - segment.from).try_normalize(1e-9).unwrap_or_default();
    move |(point, off_m)| [(point.x - off_m * along.y) as f32, (point.y + off_m * along.x) as f32, WALL_M]
}

/// The ellipse that holds the robot's position with a probability of 95 %.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "for display")]
pub(super) fn ellipse(pose: Pose2, covariance: &Matrix3<f64>) -> LineStrips3D {
    const CORNERS: u16 = 40;
    let eigen = covariance.fixed_view::<2, 2>(0, 0).into_owned().symmetric_eigen();
    let axes = eigen.eigenvalues.map(|variance| ELLIPSE_SIGMA * variance.max(0.0).sqrt());
    let corner = |corner: u16| {
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(corner) / f64::from(CORNERS));
        let off = eigen.eigenvectors * nalgebra::Vector2::new(axes[0] * cos, axes[1] * sin);
        [(pose.x_m + off.x) as f32, (pose.y_m + off.y) as f32, ELLIPSE_M]
    };
    let strip: Vec<[f32; 3]> = (0..=CORNERS).map(corner).collect();
    LineStrips3D::new([strip]).with_colors([colour(style::ESTIMATED)]).with_radii([Radius::new_ui_points(1.5)])
}

/// One piece of a path.
#[must_use]
pub(super) fn trail(piece: &[[f32; 3]], rgba: Rgba, points: f32) -> LineStrips3D {
    LineStrips3D::new([piece]).with_colors([colour(rgba)]).with_radii([Radius::new_ui_points(points)])
}
