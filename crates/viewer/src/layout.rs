//! The blueprint: the viewer's initial layout.
//!
//! Rerun's Rust blueprints (0.36) cannot set a view's eye. So the eye is logged into the blueprint's
//! own store, under the view's path.

use super::style::{self, Rgba};
use rerun::blueprint::{
    Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel, Spatial3DView,
    StateTimelineView, Tabs, TextLogView, TimePanel, TimeSeriesView, Vertical,
};
use rerun::datatypes::{TimeInt, TimeRange, TimeRangeBoundary};
use rerun::external::re_log_types::{BlueprintActivationCommand, LogMsg, StoreKind};
use rerun::external::re_sdk_types::blueprint::archetypes::{
    Background, EyeControls3D, LineGrid3D, PlotLegend, SpatialInformation, TimeAxis,
};
use rerun::external::re_sdk_types::blueprint::components::{BackgroundKind, Corner2D, PanelState, PlayState};
use rerun::{AsComponents, RecordingStream, RecordingStreamBuilder, RecordingStreamResult};

/// The application id, under which a viewer keeps its settings.
pub(super) const APPLICATION: &str = "slamd";

/// The position from which the map is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Eye {
    middle_m: [f64; 2],
    height_m: f64,
}

/// Time span of the plots before the time cursor, nanoseconds.
const PLOTTED_NS: i64 = 120_000_000_000;
/// Tangent of half the eye's vertical field of view: Rerun's is 55 degrees.
const HALF_VIEW: f64 = 0.52;
/// Width of the view divided by its height.
const ASPECT: f64 = 1.15;
const MARGIN: f64 = 1.06;

impl Default for Eye {
    /// Above the start, high enough to show a home.
    fn default() -> Self {
        Self { middle_m: [0.0, 0.0], height_m: 16.0 }
    }
}

impl Eye {
    /// High enough to show a rectangle, metres.
    #[must_use]
    pub(super) fn over(middle_m: [f64; 2], size_m: [f64; 2]) -> Self {
        let half_m = 0.5 * MARGIN * size_m[1].max(size_m[0] / ASPECT).max(2.0);
        Self { middle_m, height_m: half_m / HALF_VIEW }
    }
}

/// View properties that the blueprint's own types cannot hold, by path.
type Properties = Vec<(String, Box<dyn AsComponents>)>;

/// Sends the blueprint and activates it.
///
/// # Errors
/// As Rerun reports them.
pub(super) fn send(rec: &RecordingStream, eye: Eye) -> RecordingStreamResult<()> {
    let mut properties = Properties::new();
    let blueprint = blueprint(eye, &mut properties);
    // Collect the blueprint in memory first, so that the properties can be added to its store.
    let (scratch, storage) = RecordingStreamBuilder::new(APPLICATION).memory()?;
    blueprint.send(&scratch, BlueprintActivation::default())?;
    let mut messages: Vec<LogMsg> = storage.take();
    messages.retain(|message| message.store_id().kind() == StoreKind::Blueprint);
    let is_command = |message: &LogMsg| matches!(message, LogMsg::BlueprintActivationCommand(_));
    messages.retain(|message| !is_command(message));
    let Some(id) = messages.first().map(|message| message.store_id().clone()) else { return Ok(()) };
    let (details, storage) = RecordingStreamBuilder::from_store_id(&id).memory()?;
    details.set_time_sequence("blueprint", 0);
    for (path, property) in &properties {
        details.log(path.as_str(), property.as_ref())?;
    }
    messages.extend(storage.take());
    let command = BlueprintActivationCommand { blueprint_id: id, make_active: true, make_default: true };
    rec.send_blueprint(messages, command);
    Ok(())
}

fn blueprint(eye: Eye, properties: &mut Properties) -> Blueprint {
    let without_sensors = ["+ /map/**".into(), format!("- /{}", style::SENSORS)];
    let map = Spatial3DView::new("Map").with_origin(style::MAP).with_contents(without_sensors);
    let map = from_above(map, eye, [0.0, 1.0, 0.0], style::UNKNOWN, properties);
    let ring = Spatial3DView::new("Ring").with_origin(style::BASE_LINK).with_contents(["$origin/**"]);
    let ring = from_above(ring, Eye { middle_m: [0.0, 0.0], height_m: 7.0 }, [1.0, 0.0, 0.0], style::DARK, properties);
    let states: ContainerLike = StateTimelineView::new("Faulty sensors, position").with_origin("state").into();
    let mut plot = |name: &str, path: &str, has_legend: bool| -> ContainerLike {
        let view = TimeSeriesView::new(name).with_origin(path).into();
        let legend = PlotLegend::new().with_visible(has_legend).with_corner(Corner2D::LeftTop);
        add(properties, &view, "PlotLegend", legend);
        let (start, end) = (TimeInt(-PLOTTED_NS), TimeInt(0));
        let range =
            TimeRange { start: TimeRangeBoundary::CursorRelative(start), end: TimeRangeBoundary::CursorRelative(end) };
        add(properties, &view, "TimeAxis", TimeAxis::new().with_view_range(range));
        view
    };
    let heading = plot("Heading, degrees", style::HEADING, true);
    let nis = plot("NIS", style::NIS, true);
    let evidence = Tabs::new([
        plot("Fault score (fault above 6)", style::SCORES, false),
        plot("PCA residual, m", style::RESIDUALS, false),
    ]);
    let link = Tabs::new([
        plot("Per second", style::RATES, true),
        plot("Delay, ms", style::DELAYS, true),
        plot("Not shown", style::DROPS, true),
    ]);
    let log: ContainerLike = TextLogView::new("Log").with_origin(style::LOG).into();
    let row = |a: ContainerLike, b: ContainerLike| Horizontal::new([a, b]).into();
    let left = Vertical::new([map, log]).with_row_shares([4.6, 1.0]);
    let right = Vertical::new([row(ring, states), row(heading, nis), row(evidence.into(), link.into())])
        .with_row_shares([1.5, 1.0, 1.0]);
    let root = Horizontal::new([left.into(), right.into()]).with_column_shares([1.15, 1.0]);
    // Show the newest time, also in a file: only there the map is complete.
    let time = TimePanel::new().with_state(PanelState::Collapsed).with_timeline("robot_time");
    let time = time.with_play_state(PlayState::Following);
    Blueprint::new(root)
        .with_auto_views(false)
        .with_auto_layout(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
        .with_time_panel(time)
}

/// A view from above.
#[expect(clippy::cast_possible_truncation, reason = "for display")]
fn from_above(
    view: Spatial3DView,
    eye: Eye,
    up: [f32; 3],
    background: Rgba,
    properties: &mut Properties,
) -> ContainerLike {
    let view: ContainerLike = view.into();
    let [x_m, y_m] = eye.middle_m.map(|coordinate| coordinate as f32);
    let controls = EyeControls3D::new()
        .with_position([x_m, y_m, eye.height_m as f32])
        .with_look_target([x_m, y_m, 0.0])
        .with_eye_up(up);
    add(properties, &view, "EyeControls3D", controls);
    add(properties, &view, "LineGrid3D", LineGrid3D::new().with_visible(false));
    add(properties, &view, "SpatialInformation", SpatialInformation::update_fields().with_show_axes(false));
    let background = Background::new(BackgroundKind::SolidColor).with_color(style::colour(background));
    add(properties, &view, "Background", background);
    view
}

fn add(properties: &mut Properties, view: &ContainerLike, name: &str, property: impl AsComponents + 'static) {
    if let ContainerLike::View(view) = view {
        properties.push((format!("{}/{name}", view.blueprint_path()), Box::new(property)));
    }
}
