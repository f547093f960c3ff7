//! Nodes: what the map knows of a place apart from its surfaces.

use hachi_hal::{Pose, Rotation, Stamp, Vector3};

/// A node's number: counts from 0 over the life of a map, sessions included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NodeId(pub u32);

impl NodeId {
    /// As an index into a list of all nodes.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl std::fmt::Display for NodeId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// A piece of map: nodes that hang together. Pieces hang on each other by nothing until a place is
/// recognised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PieceId(pub u32);

/// A node: a submap's frame, and where it lies.
///
/// The frame's origin is the base at the submap's first scan; its z axis is up, its x axis the
/// base's heading on the level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Its number.
    pub id: NodeId,
    /// Which run of the robot made it: counts from 0.
    pub session: u32,
    /// The piece it hangs on.
    pub piece: PieceId,
    /// Whether odometry knows the way to it from the node before.
    pub chained: bool,
    /// The end of the submap's first scan.
    pub stamp: Stamp,
    /// Where odometry put it.
    pub odom_from_node: Pose,
    /// Where the graph puts it, in the frame of its piece; that of the first piece is the map.
    pub map_from_node: Pose,
    /// Distance travelled in the session when it began, metres.
    pub path_m: f64,
    /// The ground under it.
    pub ground: Ground,
}

/// The ground as a plane in a node's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    /// Its normal, unit length, upwards.
    pub up: [f32; 3],
    /// How far below the node's origin it is, metres.
    pub below_m: f32,
}

impl Ground {
    /// Level, so far below.
    pub const fn level(below_m: f32) -> Self {
        Self {
            up: [0.0, 0.0, 1.0],
            below_m,
        }
    }

    /// Height of a position over it, metres.
    pub fn height(&self, p: [f32; 3]) -> f32 {
        self.up[0] * p[0] + self.up[1] * p[1] + self.up[2] * p[2] + self.below_m
    }
}

/// The levelled frame of a base: the same origin, z along `up`, x the base's x laid level.
pub fn levelled(odom_from_base: &Pose, up: &Vector3) -> Pose {
    let x = odom_from_base.rotation * Vector3::x();
    let forward = x - up * up.dot(&x);
    // A base that looks straight up has no heading: any will do.
    let forward = if forward.norm() > 1e-6 {
        forward.normalize()
    } else {
        up.cross(&Vector3::y()).normalize()
    };
    let left = up.cross(&forward);
    let rotation = nalgebra::Rotation3::from_basis_unchecked(&[forward, left, *up]);
    Pose::from_parts(
        odom_from_base.translation,
        Rotation::from_rotation_matrix(&rotation),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_levelled_frame_keeps_place_and_heading_and_loses_the_tilt() {
        let tilted = Pose::from_parts(
            Vector3::new(3.0, -1.0, 0.5).into(),
            Rotation::from_euler_angles(0.2, -0.1, 1.3),
        );
        let level = levelled(&tilted, &Vector3::z());
        let (roll, pitch, yaw) = level.rotation.euler_angles();
        assert!(roll.abs() < 1e-12 && pitch.abs() < 1e-12 && (yaw - 1.3).abs() < 1e-12);
        assert_eq!(level.translation, tilted.translation);
    }
}
