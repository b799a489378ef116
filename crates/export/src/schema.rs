//! The definitions of the bag's ROS 2 messages, as `ros2 interface show` prints them, but only fields
//! and always with packages.

/// The separator between definitions.
const SEPARATOR: &str = "================================================================================";

/// Package and message, fields.
const DEFINITIONS: &[(&str, &str)] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"),
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"),
    ("geometry_msgs/PoseWithCovarianceStamped", "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n"),
    ("geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"),
    ("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance\n"),
    ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    ),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
    (
        "nav_msgs/MapMetaData",
        "builtin_interfaces/Time map_load_time\nfloat32 resolution\nuint32 width\nuint32 height\ngeometry_msgs/Pose origin\n",
    ),
    ("nav_msgs/OccupancyGrid", "std_msgs/Header header\nnav_msgs/MapMetaData info\nint8[] data\n"),
    (
        "nav_msgs/Odometry",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n",
    ),
    // With the variance that Jazzy added. Humble reads the fields before it.
    (
        "sensor_msgs/Range",
        "uint8 ULTRASOUND=0\nuint8 INFRARED=1\nstd_msgs/Header header\nuint8 radiation_type\nfloat32 field_of_view\nfloat32 min_range\nfloat32 max_range\nfloat32 range\nfloat32 variance\n",
    ),
    ("std_msgs/String", "string data\n"),
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
    ("nav_msgs/Path", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"),
    (
        "sensor_msgs/LaserScan",
        "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\nfloat32 time_increment\nfloat32 scan_time\nfloat32 range_min\nfloat32 range_max\nfloat32[] ranges\nfloat32[] intensities\n",
    ),
    (
        "sensor_msgs/PointField",
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n",
    ),
    (
        "sensor_msgs/PointCloud2",
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
    ),
    ("diagnostic_msgs/KeyValue", "string key\nstring value\n"),
    (
        "diagnostic_msgs/DiagnosticStatus",
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n",
    ),
    ("diagnostic_msgs/DiagnosticArray", "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n"),
];

/// The definition of `package/Message`, followed by each definition it needs, once, as in rosbag2.
///
/// # Panics
/// When it is not defined here.
pub(super) fn definition(name: &str) -> String {
    let mut named = vec![name];
    let mut text = String::new();
    let mut next = 0;
    while let Some(&name) = named.get(next) {
        let (_, fields) = DEFINITIONS.iter().find(|(defined, _)| *defined == name).expect("each message is defined");
        if next > 0 {
            text += &format!("{SEPARATOR}\nMSG: {name}\n");
        }
        text += fields;
        let types = fields.lines().filter_map(|line| line.split(['[', ' ']).next());
        for other in types.filter(|word| word.contains('/')) {
            if !named.contains(&other) {
                named.push(other);
            }
        }
        next += 1;
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_definition_includes_each_needed_definition_once() {
        let text = definition("nav_msgs/Odometry");
        let parts: Vec<&str> = text.split(&format!("{SEPARATOR}\n")).collect();
        let heads: Vec<&str> = parts.iter().filter_map(|part| part.lines().next()).collect();
        let expected = [
            "std_msgs/Header header",
            "MSG: std_msgs/Header",
            "MSG: geometry_msgs/PoseWithCovariance",
            "MSG: geometry_msgs/TwistWithCovariance",
            "MSG: builtin_interfaces/Time",
            "MSG: geometry_msgs/Pose",
            "MSG: geometry_msgs/Twist",
            "MSG: geometry_msgs/Point",
            "MSG: geometry_msgs/Quaternion",
            "MSG: geometry_msgs/Vector3",
        ];
        assert_eq!(heads, expected);
        assert!(text.ends_with("float64 z\n"), "{text}");
    }

    #[test]
    fn every_needed_definition_exists() {
        for (name, _) in DEFINITIONS {
            assert!(!definition(name).is_empty());
        }
    }
}
