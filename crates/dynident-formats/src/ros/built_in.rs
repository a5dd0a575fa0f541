//! Definitions of messages with joint data, for bags without definitions (rosbag2 before ROS 2 Iron). They are copied
//! from the ROS packages without comments.

const SEPARATOR: &str = "================================================================================\n";

const JOINT_STATE: &str =
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n";
const MULTI_ARRAY: &str = "MultiArrayLayout layout\nfloat64[] data\n";
const DYNAMIC_STATE: &str = "std_msgs/Header header\nstring[] joint_names\nInterfaceValue[] interface_values\n";

const LAYOUT: &str = "MSG: std_msgs/MultiArrayLayout\nMultiArrayDimension[] dim\nuint32 data_offset\n";
const DIMENSION: &str = "MSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n";
const INTERFACE: &str = "MSG: control_msgs/InterfaceValue\nstring[] interface_names\nfloat64[] values\n";
const HEADER: &str = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
const POINT: &str = "MSG: trajectory_msgs/JointTrajectoryPoint\nfloat64[] positions\nfloat64[] velocities\n\
    float64[] accelerations\nfloat64[] effort\nbuiltin_interfaces/Duration time_from_start\n";
const MULTI_POINT: &str = "MSG: trajectory_msgs/MultiDOFJointTrajectoryPoint\n\
    geometry_msgs/Transform[] transforms\ngeometry_msgs/Twist[] velocities\ngeometry_msgs/Twist[] accelerations\n\
    builtin_interfaces/Duration time_from_start\n";
const TRANSFORM: &str = "MSG: geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n";
const TWIST: &str = "MSG: geometry_msgs/Twist\nVector3 linear\nVector3 angular\n";
const VECTOR: &str = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
const QUATERNION: &str = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n";

/// Points of `JointTrajectoryControllerState` in its successive versions.
const CONTROLLER_POINTS: [&[&str]; 3] = [
    &["reference", "feedback", "error", "output", "desired", "actual"],
    &["reference", "feedback", "error", "output"],
    &["desired", "actual", "error"],
];

/// The definitions of a message type such as `sensor_msgs/msg/JointState` in all versions of its package. The first
/// definition that fits all bytes of a message is used. Empty for unknown types.
pub(crate) fn definitions_of(name: &str) -> Vec<String> {
    let joined = |parts: &[&str]| parts.join(SEPARATOR);
    match name {
        "sensor_msgs/msg/JointState" => vec![joined(&[JOINT_STATE, HEADER])],
        "std_msgs/msg/Float64MultiArray" => vec![joined(&[MULTI_ARRAY, LAYOUT, DIMENSION])],
        "control_msgs/msg/DynamicJointState" => vec![joined(&[DYNAMIC_STATE, INTERFACE, HEADER])],
        "control_msgs/msg/JointTrajectoryControllerState" => {
            let version = |points: &&[&str]| {
                let mut own = "std_msgs/Header header\nstring[] joint_names\n".to_owned();
                own.extend(points.iter().map(|point| format!("trajectory_msgs/JointTrajectoryPoint {point}\n")));
                // The oldest version has no joints with several degrees of freedom.
                if points.len() > 3 {
                    own += "string[] multi_dof_joint_names\n";
                    own.extend(
                        points
                            .iter()
                            .map(|point| format!("trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_{point}\n")),
                    );
                }
                joined(&[&own, HEADER, POINT, MULTI_POINT, TRANSFORM, TWIST, VECTOR, QUATERNION])
            };
            CONTROLLER_POINTS.iter().map(version).collect()
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::Definition;

    #[test]
    fn every_definition_is_read() {
        for (name, messages) in [
            ("sensor_msgs/msg/JointState", &[2][..]),
            ("std_msgs/msg/Float64MultiArray", &[3]),
            ("control_msgs/msg/DynamicJointState", &[3]),
            ("control_msgs/msg/JointTrajectoryControllerState", &[8, 8, 3]),
        ] {
            let found: Vec<usize> =
                definitions_of(name).iter().map(|text| Definition::parse(name, text).unwrap().messages.len()).collect();
            assert_eq!(found, messages, "{name}");
        }
    }
}
