//! The definitions of the messages, as ROS 2 publishes them, without their comments. A bag has them, so that it can be
//! read without ROS.

macro_rules! with_parts {
    ($own:literal $(, $name:literal: $part:expr)*) => {
        concat!($own $(, "================================================================================\nMSG: ", $name, "\n", $part)*)
    };
}

macro_rules! header {
    () => {
        "builtin_interfaces/Time stamp\nstring frame_id\n"
    };
}

macro_rules! time {
    () => {
        "int32 sec\nuint32 nanosec\n"
    };
}

macro_rules! xyz {
    () => {
        "float64 x\nfloat64 y\nfloat64 z\n"
    };
}

macro_rules! quaternion {
    () => {
        "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"
    };
}

pub(super) const ODOMETRY: &str = with_parts!(
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n",
    "std_msgs/Header": header!(),
    "builtin_interfaces/Time": time!(),
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation\n",
    "geometry_msgs/Point": xyz!(),
    "geometry_msgs/Quaternion": quaternion!(),
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance\n",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/Vector3": xyz!()
);

pub(super) const FIX: &str = with_parts!(
    "std_msgs/Header header\nNavSatStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n\
     float64[9] position_covariance\nuint8 COVARIANCE_TYPE_UNKNOWN=0\nuint8 COVARIANCE_TYPE_APPROXIMATED=1\n\
     uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\nuint8 COVARIANCE_TYPE_KNOWN=3\nuint8 position_covariance_type\n",
    "std_msgs/Header": header!(),
    "builtin_interfaces/Time": time!(),
    "sensor_msgs/NavSatStatus": "int8 STATUS_NO_FIX=-1\nint8 STATUS_FIX=0\nint8 STATUS_SBAS_FIX=1\nint8 STATUS_GBAS_FIX=2\nint8 status\n\
     uint16 SERVICE_GPS=1\nuint16 SERVICE_GLONASS=2\nuint16 SERVICE_COMPASS=4\nuint16 SERVICE_GALILEO=8\nuint16 service\n"
);

pub(super) const TF: &str = with_parts!(
    "geometry_msgs/TransformStamped[] transforms\n",
    "geometry_msgs/TransformStamped": "std_msgs/Header header\nstring child_frame_id\nTransform transform\n",
    "std_msgs/Header": header!(),
    "builtin_interfaces/Time": time!(),
    "geometry_msgs/Transform": "Vector3 translation\nQuaternion rotation\n",
    "geometry_msgs/Vector3": xyz!(),
    "geometry_msgs/Quaternion": quaternion!()
);

pub(super) const DIAGNOSTICS: &str = with_parts!(
    "std_msgs/Header header\nDiagnosticStatus[] status\n",
    "std_msgs/Header": header!(),
    "builtin_interfaces/Time": time!(),
    "diagnostic_msgs/DiagnosticStatus": "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\n\
     string hardware_id\nKeyValue[] values\n",
    "diagnostic_msgs/KeyValue": "string key\nstring value\n"
);
