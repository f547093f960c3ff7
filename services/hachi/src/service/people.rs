//! The tasks behind a camera: who is in view, whom the robot knows, and what others want of it.
//!
//! ```text
//! pictures ─ camera receive ─ detection ─ tracking ─ view
//!                                         │  ↑ orders
//!                                 looks,  ↓  │ news
//!                                 sittings keeper ─ names
//! ```
//!
//! In: a camera with its networks ([`Eyes`]), a table. Out: the tasks in it, and a [`PeopleDesk`] for the
//! page. Elsewhere: everything else that the service does ([`wiring`](super::wiring)).

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use hachi_people::watch::Watch;
use hachi_runtime::{TaskClock, TaskTable};

use super::camera::CameraReceive;
use super::detection::Detection;
use super::enrolment::Enrolment;
use super::keeper::{NamedEnd, keeper};
use super::messages::{BeltEnd, Looked, Picture, belt};
use super::orders::{Desk, orders};
use super::reception::Reception;
use super::rows;
use super::settings::row;
use super::signs::SharedSigns;
use super::tracking::Tracking;
use super::view::View;
use super::wiring::Eyes;
use crate::config::Settings;

/// An order about people is waited for so long: most are carried out with the next picture, one that
/// points at nobody takes a second of pictures.
const ORDER_PATIENCE: Duration = Duration::from_secs(3);

/// Where people are told of, and orders about them taken.
pub struct PeopleDesk {
    /// Orders.
    pub desk: Desk,
    /// Who is in view.
    pub views: BeltEnd<View>,
    /// What the known are called; nobody is kept without.
    pub named: Option<NamedEnd>,
    /// Whether people can be told apart.
    pub tells_apart: bool,
    /// The clock of pictures.
    pub clock: TaskClock,
}

/// Why there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoPeople {
    /// The settings do not ask for people.
    NotAskedFor,
    /// The networks that find them are not there.
    NoNetworks,
}

/// Adds the tasks.
///
/// # Errors
/// Why people are not told of; the rest of the service goes on.
pub fn open(
    eyes: Eyes,
    settings: &Settings,
    table: &mut TaskTable,
    signs: &SharedSigns,
) -> Result<PeopleDesk, NoPeople> {
    signs
        .model_missing
        .store(eyes.model_missing, Ordering::Relaxed);
    let [to_detection, to_tracking] = [0; 2].map(|_| table.bell());
    // Of pictures only the newest counts.
    let (pictures, pictures_end) = belt::<Picture>(table, "pictures", 1, &to_detection);
    let (looked, looked_end) = belt::<Looked>(table, "looked at", 2, &to_tracking);
    let receive = CameraReceive {
        camera: eyes.camera,
        out: pictures,
        signs: Arc::clone(signs),
        retry_at: None,
    };
    let bell = table.bell();
    let spec = row(settings, rows::CAMERA_RECEIVE);
    table.add(spec, bell, vec![], Box::new(receive));
    let Some(mut people) = eyes.people else {
        return Err(match eyes.model_missing {
            true => NoPeople::NoNetworks,
            false => NoPeople::NotAskedFor,
        });
    };
    let tells_apart = people.observer.appearance().is_some();
    let nobody = table.bell();
    let (desk, inbox) = orders(&to_tracking, &nobody, ORDER_PATIENCE);
    let waiting = inbox.gauge();
    // Of what is known only the newest counts: that the rest goes is no loss, and is not told.
    let (views, views_end) = belt::<View>(table, "views", 1, &nobody);
    let mut reception = Reception::new(inbox, views, Arc::clone(signs));
    let named = people.kept.map(|kept| {
        let ends = keeper(kept, &to_tracking, &nobody, Arc::clone(signs));
        let (spec, bell) = (row(settings, rows::KEEPER), table.bell());
        table.add(spec, bell, vec![], Box::new(ends.keeper));
        reception.acquaintances = Some(ends.acquaintances);
        reception.enrolment = Some(Enrolment::new(ends.sittings));
        ends.named
    });

    let watch = Watch::new(people.observer.even_score(), settings.people.identify);
    let gauges = vec![pictures_end.full.gauge()];
    let detection = Detection {
        observer: people.observer,
        pictures: pictures_end,
        out: looked,
        signs: Arc::clone(signs),
        count: 0,
        level: 0,
    };
    let spec = row(settings, rows::DETECTION);
    table.add(spec, to_detection, gauges, Box::new(detection));

    let gauges = vec![looked_end.full.gauge(), waiting];
    let tracking = Tracking {
        watch,
        looked: looked_end,
        last: None,
        reception,
        audience: people.audience,
        latency: table.latency("shutter to target"),
        clock: table.clock().clone(),
        signs: Arc::clone(signs),
        said: None,
    };
    let spec = row(settings, rows::TRACKING);
    table.add(spec, to_tracking, gauges, Box::new(tracking));
    Ok(PeopleDesk {
        desk,
        views: views_end,
        named,
        tells_apart,
        clock: table.clock().clone(),
    })
}
