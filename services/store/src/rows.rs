//! Poses, matrices and ledger entries as columns, and back.

use hachi_hal::{Pose, Rotation, Stamp, Vector3};
use hachi_slam::ledger::{FoundBy, LedgerEntry, LoopId, Verdict};
use hachi_slam::node::{Ground, Node, NodeId, PieceId};
use nalgebra::{Matrix6, Quaternion};
use rusqlite::Row;
use rusqlite::types::{FromSqlError, Type};

/// A pose as seven numbers.
pub(crate) fn pose_bytes(pose: &Pose) -> [u8; 56] {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    let numbers = [t.x, t.y, t.z, q.x, q.y, q.z, q.w];
    let mut bytes = [0; 56];
    for (chunk, number) in bytes.chunks_exact_mut(8).zip(numbers) {
        chunk.copy_from_slice(&number.to_le_bytes());
    }
    bytes
}

/// The upper triangle of a matrix, row by row.
pub(crate) fn matrix_bytes(matrix: &Matrix6<f64>) -> [u8; 168] {
    let upper = (0..6).flat_map(|r| (r..6).map(move |c| (r, c)));
    let mut bytes = [0; 168];
    for (chunk, (r, c)) in bytes.chunks_exact_mut(8).zip(upper) {
        chunk.copy_from_slice(&matrix[(r, c)].to_le_bytes());
    }
    bytes
}

fn numbers<const N: usize>(row: &Row<'_>, column: usize) -> rusqlite::Result<[f64; N]> {
    let bytes = row.get_ref(column)?.as_blob()?;
    if bytes.len() != 8 * N {
        return Err(odd(
            column,
            format!("{} bytes where {} belong", bytes.len(), 8 * N),
        ));
    }
    let mut out = [0.0; N];
    for (number, chunk) in out.iter_mut().zip(bytes.chunks_exact(8)) {
        let mut eight = [0; 8];
        eight.copy_from_slice(chunk);
        *number = f64::from_le_bytes(eight);
    }
    Ok(out)
}

/// A column that holds what we never write.
fn odd(column: usize, what: String) -> rusqlite::Error {
    rusqlite::Error::FromSqlConversionFailure(
        column,
        Type::Blob,
        Box::new(FromSqlError::Other(what.into())),
    )
}

pub(crate) fn pose(row: &Row<'_>, column: usize) -> rusqlite::Result<Pose> {
    let [x, y, z, qx, qy, qz, qw] = numbers::<7>(row, column)?;
    let q = Quaternion::new(qw, qx, qy, qz);
    // What is no rotation is found by the map's own check.
    Ok(Pose::from_parts(
        Vector3::new(x, y, z).into(),
        Rotation::new_unchecked(q),
    ))
}

pub(crate) fn matrix(row: &Row<'_>, column: usize) -> rusqlite::Result<Matrix6<f64>> {
    let upper = numbers::<21>(row, column)?;
    let mut out = Matrix6::zeros();
    let places = (0..6).flat_map(|r| (r..6).map(move |c| (r, c)));
    for ((r, c), value) in places.zip(upper) {
        out[(r, c)] = value;
        out[(c, r)] = value;
    }
    Ok(out)
}

pub(crate) fn node(row: &Row<'_>) -> rusqlite::Result<Node> {
    Ok(Node {
        id: NodeId(row.get(0)?),
        session: row.get(1)?,
        piece: PieceId(row.get(2)?),
        chained: row.get(3)?,
        stamp: Stamp::from_nanos(row.get(4)?),
        path_m: row.get(5)?,
        ground: Ground {
            up: [single(row, 6)?, single(row, 7)?, single(row, 8)?],
            below_m: single(row, 9)?,
        },
        odom_from_node: pose(row, 10)?,
        map_from_node: pose(row, 11)?,
    })
}

fn single(row: &Row<'_>, column: usize) -> rusqlite::Result<f32> {
    Ok(row.get::<_, f64>(column)? as f32)
}

/// A figure that may not have been asked for.
fn figure(row: &Row<'_>, column: usize) -> rusqlite::Result<f32> {
    Ok(row
        .get::<_, Option<f64>>(column)?
        .map_or(f32::NAN, |v| v as f32))
}

pub(crate) fn ledger_entry(row: &Row<'_>) -> rusqlite::Result<LedgerEntry> {
    let word = |column: usize| -> rusqlite::Result<String> { row.get(column) };
    let (by, verdict) = (word(4)?, word(18)?);
    let found_by = FoundBy::ALL.into_iter().find(|f| f.name() == by);
    Ok(LedgerEntry {
        id: LoopId(row.get(0)?),
        stamp: Stamp::from_nanos(row.get(1)?),
        node: NodeId(row.get(2)?),
        candidate: NodeId(row.get(3)?),
        found_by: found_by.ok_or_else(|| odd(4, format!("found by {by:?}")))?,
        similarity: figure(row, 5)?,
        yaw_rad: figure(row, 6)?,
        distance_m: figure(row, 7)?,
        graph_fitness: figure(row, 8)?,
        looks_fitness: figure(row, 9)?,
        overlap: figure(row, 10)?,
        inlier_share: figure(row, 11)?,
        residual_m: figure(row, 12)?,
        seen_through: figure(row, 13)?,
        open: row.get(14)?,
        chi2: figure(row, 15)?,
        agreeing: row.get(16)?,
        candidate_from_node: pose(row, 17)?,
        verdict: Verdict::from_name(&verdict)
            .ok_or_else(|| odd(18, format!("verdict {verdict:?}")))?,
    })
}

/// A figure as a column: none where it was not asked for.
pub(crate) fn column(figure: f32) -> Option<f64> {
    figure.is_finite().then(|| f64::from(figure))
}
