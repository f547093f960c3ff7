//! The definitions of the messages in a recording, as ROS 2 has them (common_interfaces, velodyne
//! and rslidar_msg packages), in MCAP's `ros2msg` form: the message, then each type it uses.

/// A data packet of a Velodyne.
pub const VELODYNE_BYTES: usize = 1206;

/// Joints in the order of the robots' arrays.
pub const JOINTS: [&str; 12] = [
    "FR_hip_joint",
    "FR_thigh_joint",
    "FR_calf_joint",
    "FL_hip_joint",
    "FL_thigh_joint",
    "FL_calf_joint",
    "RR_hip_joint",
    "RR_thigh_joint",
    "RR_calf_joint",
    "RL_hip_joint",
    "RL_thigh_joint",
    "RL_calf_joint",
];

const HEADER: (&str, &str) = (
    "std_msgs/Header",
    "builtin_interfaces/Time stamp\nstring frame_id\n",
);
const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const VECTOR3: (&str, &str) = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
const POINT: (&str, &str) = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
const QUATERNION: (&str, &str) = (
    "geometry_msgs/Quaternion",
    "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
);

/// The definition of a message with those of the types that it uses.
fn whole(message: &str, uses: &[(&str, &str)]) -> String {
    let mut text = message.to_owned();
    for (name, definition) in uses {
        let line = "=".repeat(80);
        text.push_str(&format!("{line}\nMSG: {name}\n{definition}"));
    }
    text
}

/// `velodyne_msgs/VelodyneScan`.
pub fn velodyne_scan() -> (&'static str, String) {
    let packet = (
        "velodyne_msgs/VelodynePacket",
        "builtin_interfaces/Time stamp\nuint8[1206] data\n",
    );
    let message = "std_msgs/Header header\nvelodyne_msgs/VelodynePacket[] packets\n";
    let text = whole(message, &[HEADER, TIME, packet]);
    ("velodyne_msgs/msg/VelodyneScan", text)
}

/// `rslidar_msg/RslidarPacket`.
pub fn rslidar_packet() -> (&'static str, String) {
    let message = "std_msgs/Header header\nuint8 is_difop\nuint8 is_frame_begin\nuint8[] data\n";
    (
        "rslidar_msg/msg/RslidarPacket",
        whole(message, &[HEADER, TIME]),
    )
}

/// `sensor_msgs/Imu`.
pub fn imu() -> (&'static str, String) {
    let message = "std_msgs/Header header\n\
                   geometry_msgs/Quaternion orientation\n\
                   float64[9] orientation_covariance\n\
                   geometry_msgs/Vector3 angular_velocity\n\
                   float64[9] angular_velocity_covariance\n\
                   geometry_msgs/Vector3 linear_acceleration\n\
                   float64[9] linear_acceleration_covariance\n";
    let text = whole(message, &[HEADER, TIME, QUATERNION, VECTOR3]);
    ("sensor_msgs/msg/Imu", text)
}

/// `sensor_msgs/JointState`.
pub fn joint_state() -> (&'static str, String) {
    let message = "std_msgs/Header header\nstring[] name\nfloat64[] position\n\
                   float64[] velocity\nfloat64[] effort\n";
    (
        "sensor_msgs/msg/JointState",
        whole(message, &[HEADER, TIME]),
    )
}

/// `nav_msgs/Odometry`.
pub fn odometry() -> (&'static str, String) {
    let message = "std_msgs/Header header\nstring child_frame_id\n\
                   geometry_msgs/PoseWithCovariance pose\n\
                   geometry_msgs/TwistWithCovariance twist\n";
    let uses = [
        HEADER,
        TIME,
        (
            "geometry_msgs/PoseWithCovariance",
            "geometry_msgs/Pose pose\nfloat64[36] covariance\n",
        ),
        (
            "geometry_msgs/Pose",
            "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
        ),
        POINT,
        QUATERNION,
        (
            "geometry_msgs/TwistWithCovariance",
            "geometry_msgs/Twist twist\nfloat64[36] covariance\n",
        ),
        (
            "geometry_msgs/Twist",
            "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
        ),
        VECTOR3,
    ];
    ("nav_msgs/msg/Odometry", whole(message, &uses))
}
