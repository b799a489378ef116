//! The MCAP file as rosbag2 writes it: profile `ros2`, messages in CDR with their definitions. The
//! file is complete or absent.

use super::message::{Stamp, sonar};
use super::schema::definition;
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions, Writer};
use slamd_files::{CompleteFile, Output, PartFile, WriteError};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A bag that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum BagError {
    /// The file cannot be created or written.
    #[error(transparent)]
    File(#[from] WriteError),
    /// The MCAP writer fails.
    #[error("{}: {source}", path.display())]
    Mcap {
        /// The bag.
        path: PathBuf,
        /// The MCAP writer's error.
        source: Box<McapError>,
    },
}

/// The topic of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Topic {
    Map,
    Odometry,
    Pose,
    Transforms,
    StaticTransforms,
    Diagnostics,
    Path,
    Scan,
    Points,
    Description,
    Sonar(usize),
}

/// The MCAP channel of a topic.
struct Channel {
    id: u16,
    messages: u32,
}

/// A bag file being written.
pub(super) struct BagFile {
    path: PathBuf,
    writer: Writer<NoSeek<PartFile>>,
    channels: BTreeMap<Topic, Channel>,
}

impl Topic {
    /// The topic's ROS 2 name. No part of a name may begin with a digit.
    fn name(self) -> String {
        match self {
            Self::Map => "/map".into(),
            Self::Odometry => "/odom".into(),
            Self::Pose => "/pose".into(),
            Self::Transforms => "/tf".into(),
            Self::StaticTransforms => "/tf_static".into(),
            Self::Diagnostics => "/diagnostics".into(),
            Self::Path => "/path".into(),
            Self::Scan => "/scan".into(),
            Self::Points => "/points".into(),
            Self::Description => "/robot_description".into(),
            Self::Sonar(sensor) => format!("/{}", sonar(sensor)),
        }
    }

    const fn package_and_message(self) -> (&'static str, &'static str) {
        match self {
            Self::Map => ("nav_msgs", "OccupancyGrid"),
            Self::Odometry => ("nav_msgs", "Odometry"),
            Self::Pose => ("geometry_msgs", "PoseWithCovarianceStamped"),
            Self::Transforms | Self::StaticTransforms => ("tf2_msgs", "TFMessage"),
            Self::Diagnostics => ("diagnostic_msgs", "DiagnosticArray"),
            Self::Path => ("nav_msgs", "Path"),
            Self::Scan => ("sensor_msgs", "LaserScan"),
            Self::Points => ("sensor_msgs", "PointCloud2"),
            Self::Description => ("std_msgs", "String"),
            Self::Sonar(_) => ("sensor_msgs", "Range"),
        }
    }

    /// The quality of service. Late joiners receive the last message of the map, the path, the
    /// description and the static transforms, as with `map_server`.
    fn offered_qos_profiles(self) -> String {
        const FOREVER: &str = "\n    sec: 9223372036\n    nsec: 854775807\n";
        let is_kept = matches!(self, Self::Map | Self::StaticTransforms | Self::Path | Self::Description);
        let (depth, durability) = if is_kept { (1, TRANSIENT_LOCAL) } else { (10, VOLATILE) };
        format!(
            "- history: {KEEP_LAST}\n  depth: {depth}\n  reliability: {RELIABLE}\n  durability: {durability}\n  deadline:{FOREVER}  \
             lifespan:{FOREVER}  liveliness: {AUTOMATIC}\n  liveliness_lease_duration:{FOREVER}  avoid_ros_namespace_conventions: false"
        )
    }
}

/// Values from `rmw/types.h`.
const KEEP_LAST: u8 = 1;
const RELIABLE: u8 = 1;
const TRANSIENT_LOCAL: u8 = 1;
const VOLATILE: u8 = 2;
const AUTOMATIC: u8 = 1;

impl BagFile {
    pub(super) fn create(output: Output) -> Result<Self, BagError> {
        let path = output.path().to_owned();
        let writer = begin(output.begin()?).map_err(|error| bag_error(&path, error))?;
        Ok(Self { path, writer, channels: BTreeMap::new() })
    }

    /// Writes a message that was ready at `ready`. Times must not decrease.
    pub(super) fn write(&mut self, topic: Topic, ready: Stamp, message: &[u8]) -> Result<(), BagError> {
        let Self { path, writer, channels } = self;
        let channel = match channels.entry(topic) {
            std::collections::btree_map::Entry::Occupied(known) => known.into_mut(),
            std::collections::btree_map::Entry::Vacant(new) => {
                new.insert(add(writer, topic).map_err(|error| bag_error(path, error))?)
            }
        };
        let Stamp(log_time) = ready;
        let header =
            MessageHeader { channel_id: channel.id, sequence: channel.messages, log_time, publish_time: log_time };
        channel.messages = channel.messages.wrapping_add(1);
        writer.write_to_known_channel(&header, message).map_err(|error| bag_error(path, error))
    }

    /// Completes the file, which has no name yet. Returns it with the numbers of messages and topics.
    pub(super) fn complete(mut self) -> Result<(CompleteFile, u64, usize), BagError> {
        self.writer.finish().map_err(|error| bag_error(&self.path, error))?;
        let file = self.writer.into_inner().into_inner().complete()?;
        let messages = self.channels.values().map(|channel| u64::from(channel.messages)).sum();
        Ok((file, messages, self.channels.len()))
    }
}

fn begin(file: PartFile) -> Result<Writer<NoSeek<PartFile>>, McapError> {
    let options = WriteOptions::new()
        .compression(None)
        .disable_seeking(true)
        .profile("ros2")
        .library(concat!("slamd ", env!("CARGO_PKG_VERSION")));
    let mut writer = options.create(NoSeek::new(file))?;
    // An empty record tells rosbag2 that qualities of service are numbers, as in Humble. Without it,
    // Jazzy expects words.
    let metadata = BTreeMap::from([("serialized_metadata".into(), String::new())]);
    writer.write_metadata(&Metadata { name: "rosbag2".into(), metadata })?;
    Ok(writer)
}

fn add(writer: &mut Writer<NoSeek<PartFile>>, topic: Topic) -> Result<Channel, McapError> {
    let (package, message) = topic.package_and_message();
    let definition = definition(&format!("{package}/{message}"));
    let schema = writer.add_schema(&format!("{package}/msg/{message}"), "ros2msg", definition.as_bytes())?;
    let metadata = BTreeMap::from([("offered_qos_profiles".into(), topic.offered_qos_profiles())]);
    Ok(Channel { id: writer.add_channel(schema, &topic.name(), "cdr", &metadata)?, messages: 0 })
}

fn bag_error(path: &Path, error: McapError) -> BagError {
    match error {
        McapError::Io(source) => BagError::File(WriteError { path: path.into(), source }),
        other => BagError::Mcap { path: path.into(), source: Box::new(other) },
    }
}
