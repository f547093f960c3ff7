//! Manifests of published models, for files that have none beside them.

/// The manifest of a model by the name of its file, without `.onnx`.
pub fn manifest(name: &str) -> Option<&'static str> {
    let known = KNOWN.iter().find(|(stem, _)| *stem == name);
    known.map(|(_, text)| *text)
}

/// Names of files with a known manifest, and the manifests.
pub const KNOWN: [(&str, &str); 4] = [
    (
        "yolox_nano_416x416",
        include_str!("known/yolox_nano_416x416.toml"),
    ),
    (
        "yolov8n-seg_int8",
        include_str!("known/yolov8n-seg_int8.toml"),
    ),
    (
        "osnet_x0_25_msmt17",
        include_str!("known/osnet_x0_25_msmt17.toml"),
    ),
    (
        "person-reidentification-retail-0288",
        include_str!("known/person-reidentification-retail-0288.toml"),
    ),
];
