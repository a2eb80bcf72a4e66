"""Messages of detectors and trackers, by the definitions of their packages."""

from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

_POSE_WITH = "geometry_msgs/PoseWithCovariance pose\n"
_OBJECT = (
    "std_msgs/Header header\nuint32 id\nuint8 detection_level\nuint8 OBJECT_DETECTED=0\nuint8 OBJECT_TRACKED=1\n"
    "bool object_classified\n{pose} pose\n{twist} twist\n{accel} accel\ngeometry_msgs/Polygon polygon\n"
    "shape_msgs/SolidPrimitive shape\nuint8 classification\nuint8 CLASSIFICATION_UNKNOWN=0\n"
    "uint8 CLASSIFICATION_PEDESTRIAN=4\nuint8 CLASSIFICATION_CAR=6\nuint8 classification_certainty\n"
    "uint32 classification_age\n"
)


def _zed(package: str) -> dict[str, str]:
    return {
        f"{package}/msg/Keypoint2Di": "uint32[2] kp\n",
        f"{package}/msg/Keypoint2Df": "float32[2] kp\n",
        f"{package}/msg/Keypoint3D": "float32[3] kp\n",
        f"{package}/msg/BoundingBox2Di": f"{package}/Keypoint2Di[4] corners\n",
        f"{package}/msg/BoundingBox2Df": f"{package}/Keypoint2Df[4] corners\n",
        f"{package}/msg/BoundingBox3D": f"{package}/Keypoint3D[8] corners\n",
        f"{package}/msg/Skeleton2D": f"{package}/Keypoint2Df[70] keypoints\n",
        f"{package}/msg/Skeleton3D": f"{package}/Keypoint3D[70] keypoints\n",
        f"{package}/msg/Object": "string label\nint16 label_id\nstring sublabel\nfloat32 confidence\n"
        "float32[3] position\nfloat32[6] position_covariance\nfloat32[3] velocity\nbool tracking_available\n"
        f"int8 tracking_state\nint8 action_state\n{package}/BoundingBox2Di bounding_box_2d\n"
        f"{package}/BoundingBox3D bounding_box_3d\nfloat32[3] dimensions_3d\nbool skeleton_available\n"
        f"int8 body_format\n{package}/BoundingBox2Df head_bounding_box_2d\n"
        f"{package}/BoundingBox3D head_bounding_box_3d\n"
        f"float32[3] head_position\n{package}/Skeleton2D skeleton_2d\n{package}/Skeleton3D skeleton_3d\n",
        f"{package}/msg/ObjectsStamped": f"std_msgs/Header header\n{package}/Object[] objects\n",
    }


def _autoware(package: str) -> dict[str, str]:
    parts = {
        f"{package}/msg/ObjectClassification": "uint8 UNKNOWN=0\nuint8 CAR=1\nuint8 PEDESTRIAN=7\nuint8 label\n"
        "float32 probability\n",
        f"{package}/msg/Shape": "uint8 type\ngeometry_msgs/Polygon footprint\ngeometry_msgs/Vector3 dimensions\n",
    }
    for kind in ("Tracked", "Detected"):
        parts[f"{package}/msg/{kind}ObjectKinematics"] = (
            "geometry_msgs/PoseWithCovariance pose_with_covariance\n"
            "geometry_msgs/TwistWithCovariance twist_with_covariance\n"
        )
        parts[f"{package}/msg/{kind}Object"] = (
            f"float32 existence_probability\n{package}/ObjectClassification[] classification\n"
            f"{package}/{kind}ObjectKinematics kinematics\n{package}/Shape shape\n"
        )
        parts[f"{package}/msg/{kind}Objects"] = f"std_msgs/Header header\n{package}/{kind}Object[] objects\n"
    return parts


#: Definitions by name, as far as the types of ROS do not have them.
DEFINITIONS: dict[str, str] = {
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": f"vision_msgs/ObjectHypothesis hypothesis\n{_POSE_WITH}",
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    "vision_msgs/msg/Detection3D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox3D bbox\nstring id\n",
    "vision_msgs/msg/Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections\n",
    "derived_object_msgs/msg/Object": _OBJECT.format(
        pose="geometry_msgs/Pose", twist="geometry_msgs/Twist", accel="geometry_msgs/Accel"
    ),
    "derived_object_msgs/msg/ObjectArray": "std_msgs/Header header\nderived_object_msgs/Object[] objects\n",
    "derived_object_msgs/msg/ObjectWithCovariance": _OBJECT.format(
        pose="geometry_msgs/PoseWithCovariance",
        twist="geometry_msgs/TwistWithCovariance",
        accel="geometry_msgs/AccelWithCovariance",
    ),
    "derived_object_msgs/msg/ObjectWithCovarianceArray": "std_msgs/Header header\n"
    "derived_object_msgs/ObjectWithCovariance[] objects\n",
    **_zed("zed_msgs"),
    **_zed("zed_interfaces"),
    **_autoware("autoware_perception_msgs"),
    **_autoware("autoware_auto_perception_msgs"),
    "yolo_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\nstring frame_id\n",
    "yolo_msgs/msg/Detection": "int32 class_id\nstring class_name\nfloat64 score\nstring id\n"
    "yolo_msgs/BoundingBox3D bbox3d\n",
    "yolo_msgs/msg/DetectionArray": "std_msgs/Header header\nyolo_msgs/Detection[] detections\n",
    "leg_tracker/msg/Person": "geometry_msgs/Pose pose\nuint32 id\n",
    "leg_tracker/msg/PersonArray": "std_msgs/Header header\nleg_tracker/Person[] people\n",
    "leg_detector_msgs/msg/Person": "geometry_msgs/Pose pose\nuint32 id\n",
    "leg_detector_msgs/msg/PersonArray": "std_msgs/Header header\nleg_detector_msgs/Person[] people\n",
    "people_msgs/msg/PositionMeasurement": "std_msgs/Header header\nstring name\nstring object_id\n"
    "geometry_msgs/Point pos\nfloat64 reliability\nfloat64[9] covariance\nbyte initialization\n",
    "people_msgs/msg/PositionMeasurementArray": "std_msgs/Header header\npeople_msgs/PositionMeasurement[] people\n"
    "float32[] cooccurrence\n",
    "pedsim_msgs/msg/AgentState": "std_msgs/Header header\nuint64 id\nuint16 type\nstring social_state\n"
    "geometry_msgs/Pose pose\ngeometry_msgs/Twist twist\n",
    "pedsim_msgs/msg/AgentStates": "std_msgs/Header header\npedsim_msgs/AgentState[] agent_states\n",
    "pedsim_msgs/msg/TrackedPerson": "uint64 track_id\nbool is_occluded\n"
    f"{_POSE_WITH}geometry_msgs/TwistWithCovariance twist\n",
    "pedsim_msgs/msg/TrackedPersons": "std_msgs/Header header\npedsim_msgs/TrackedPerson[] tracks\n",
    "spencer_tracking_msgs/msg/DetectedPerson": "uint64 detection_id\nfloat64 confidence\n"
    f"{_POSE_WITH}string modality\n",
    "spencer_tracking_msgs/msg/DetectedPersons": "std_msgs/Header header\n"
    "spencer_tracking_msgs/DetectedPerson[] detections\n",
    "action_msgs/msg/GoalInfo": "unique_identifier_msgs/UUID goal_id\nbuiltin_interfaces/Time stamp\n",
    "action_msgs/msg/GoalStatus": "int8 STATUS_EXECUTING=2\nint8 STATUS_SUCCEEDED=4\naction_msgs/GoalInfo goal_info\n"
    "int8 status\n",
    "action_msgs/msg/GoalStatusArray": "action_msgs/GoalStatus[] status_list\n",
    **{
        name: text
        for kind in ("NavigateToPose", "NavigateThroughPoses")
        for name, text in {
            f"nav2_msgs/action/{kind}_Feedback": "geometry_msgs/PoseStamped current_pose\n"
            "builtin_interfaces/Duration navigation_time\nbuiltin_interfaces/Duration estimated_time_remaining\n"
            "int16 number_of_recoveries\nfloat32 distance_remaining\n",
            f"nav2_msgs/action/{kind}_FeedbackMessage": "unique_identifier_msgs/UUID goal_id\n"
            f"nav2_msgs/action/{kind}_Feedback feedback\n",
        }.items()
    },
}
#: Definitions of other releases.
OLDER: dict[str, str] = {
    "vision_msgs/msg/ObjectHypothesisWithPose": f"int64 id\nfloat64 score\n{_POSE_WITH}",
    "vision_msgs/msg/Detection3D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox3D bbox\nbool is_tracking\nstring tracking_id\n",
    "pedsim_msgs/msg/AgentState": "std_msgs/Header header\nint16 id\nint16 type\nint16 social_state\n"
    "geometry_msgs/Point position\ngeometry_msgs/Point velocity\n",
}


def _store(definitions: dict[str, str]) -> Typestore:
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name in definitions:
        store.fielddefs.pop(name, None)
    types = {}
    for name, text in definitions.items():
        types.update(get_types_from_msg(text, name))
    store.register(types)
    return store


NOW, THEN = _store(DEFINITIONS), _store({**DEFINITIONS, **OLDER})


def definition(store: Typestore, name: str) -> str:
    """A type's definition as rosbag2 embeds it."""
    if "/action/" not in name:
        return store.generate_msgdef(name, ros_version=2)[0]
    feedback = name.removesuffix("Message")
    needed = ("unique_identifier_msgs/msg/UUID", "geometry_msgs/msg/PoseStamped", "builtin_interfaces/msg/Duration")
    parts = [f"MSG: {one}\n{definition(store, one)}" for one in needed]
    separator = "=" * 80 + "\n"
    return separator.join([DEFINITIONS[name], f"MSG: {feedback}\n{DEFINITIONS[feedback]}", *parts])


def made(store: Typestore, name: str, given: Any) -> Any:
    """A message from the fields that are given, the others 0 or empty."""
    fields = {}
    for field, desc in store.fielddefs[name][1]:
        fields[field] = _value(store, desc, given.get(field))
    unknown = set(given) - set(fields)
    assert not unknown, f"{name} has no {unknown}"
    return store.types[name](**fields)


def _value(store: Typestore, desc: Any, given: Any) -> Any:
    if desc[0] == Nodetype.NAME:
        return given if hasattr(given, "__msgtype__") else made(store, desc[1], given or {})
    if desc[0] == Nodetype.BASE:
        return given if given is not None else "" if desc[1][0] == "string" else 0
    inner, count = desc[1]
    if inner[0] == Nodetype.BASE and inner[1][0] != "string":
        dtype = {"byte": "uint8", "char": "uint8"}.get(inner[1][0], inner[1][0])
        return np.array(given if given is not None else [0] * count, dtype=dtype)
    fixed = desc[0] == Nodetype.ARRAY and given is None
    return [_value(store, inner, one) for one in ([None] * count if fixed else given or [])]
