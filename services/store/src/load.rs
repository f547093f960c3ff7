//! Reading a whole map but its submaps.

use hachi_slam::edge::{Edge, EdgeKind};
use hachi_slam::ledger::LoopId;
use hachi_slam::node::NodeId;
use hachi_slam::saved::{MOST_NODES, SavedMap};
use rusqlite::{Connection, Row};

use crate::rows;

/// Reads all tables; whether they fit together is the map's own check.
pub(crate) fn load(connection: &Connection) -> rusqlite::Result<SavedMap> {
    Ok(SavedMap {
        nodes: all(
            connection,
            "SELECT id, session, piece, chained, stamp_ns, path_m, ground_up_x, ground_up_y, \
             ground_up_z, ground_below_m, odom_from_node, map_from_node FROM node ORDER BY id",
            rows::node,
        )?,
        descriptors: all(
            connection,
            "SELECT node, descriptor FROM place ORDER BY node",
            |row| Ok((NodeId(row.get(0)?), row.get(1)?)),
        )?,
        edges: all(
            connection,
            "SELECT id, loop, first, second, first_from_second, information FROM edge ORDER BY id",
            edge,
        )?,
        ledger: all(
            connection,
            "SELECT id, stamp_ns, node, candidate, found_by, similarity, yaw_rad, distance_m, \
             graph_fitness, looks_fitness, overlap, inlier_share, residual_m, seen_through, open, chi2, agreeing, \
             candidate_from_node, verdict FROM ledger ORDER BY id",
            rows::ledger_entry,
        )?,
    })
}

fn edge(row: &Row<'_>) -> rusqlite::Result<Edge> {
    let of_loop: Option<u32> = row.get(1)?;
    Ok(Edge {
        id: row.get(0)?,
        kind: of_loop.map_or(EdgeKind::Chain, |id| EdgeKind::Loop(LoopId(id))),
        first: NodeId(row.get(2)?),
        second: NodeId(row.get(3)?),
        first_from_second: rows::pose(row, 4)?,
        information: rows::matrix(row, 5)?,
    })
}

/// All rows of a query, of which there are no more than a map can have.
fn all<T>(
    connection: &Connection,
    query: &str,
    read: impl Fn(&Row<'_>) -> rusqlite::Result<T>,
) -> rusqlite::Result<Vec<T>> {
    /// A node has a few edges and ledger entries.
    const MOST: usize = 8 * MOST_NODES;
    let mut statement = connection.prepare(query)?;
    let mut rows = statement.query([])?;
    let mut out = Vec::new();
    while let Some(row) = rows.next()?
        && out.len() < MOST
    {
        out.push(read(row)?);
    }
    Ok(out)
}
