//! `/people`: who is in view and whom the robot knows, and orders about them.
//!
//! In: requests of callers on this computer, what tracking and the keeper left. Out: [`People`] as JSON,
//! or what became of an order. Names are told here and nowhere else. Whoever calls from elsewhere is
//! refused, because a token and TLS would be needed for that and there is neither; and so is what a web
//! page may have sent (`hachi_http::guard`). Elsewhere: the JSON itself ([`shapes`](super::shapes)), and
//! the sentences ([`sentences`](super::sentences)).
//!
//! | request | body | does |
//! |---|---|---|
//! | `GET /people` | | tells [`People`] |
//! | `POST /people/pick` | `{"track": 3}` or `{"at": [x, y]}`, pixels | makes somebody the robot's person |
//! | `POST /people/enrol` | `{"name": "Anna"}` | begins to enrol whoever stands in front |
//! | `POST /people/cancel` | `{}` | ends that |
//! | `POST /people/release` | `{}` | the robot has no person any more |

use std::time::{Duration, Instant};

use hachi_hal::Clock;
use hachi_http::{Method, Request, Response, guard};
use hachi_people::pointing::Pointed;
use hachi_store::people::{StoredId, check_form_of_name};
use serde::Deserialize;
use tracing::info;

use super::sentences::{Refused, advice, json, none, not_begun, said};
use super::shapes::{
    BareOrder, BoxStatus, EnrolOrder, EnrolmentStatus, ErrorStatus, InViewStatus, KnownStatus,
    People, PickOrder, PictureStatus,
};
use crate::service::enrolment;
use crate::service::keeper::Names;
use crate::service::orders::{NotBegun, Order};
use crate::service::people::{NoPeople, PeopleDesk};
use crate::service::view::View;

/// Where it is told.
pub const PATH: &str = "/people";
/// Where orders are taken.
pub const BELOW: &str = "/people/";

/// Orders that may come at once, and how long it takes until one more may.
const AT_ONCE: u32 = 5;
const EVERY: Duration = Duration::from_millis(500);
/// A place in a picture is not further away, pixels.
const FARTHEST: f64 = 1e5;

/// The page.
pub struct PeoplePage {
    people: Result<PeopleDesk, NoPeople>,
    view: Box<View>,
    names: Names,
    /// The enrolment that failed last, and why.
    failed: Option<(u32, String)>,
    budget: Budget,
}

impl PeoplePage {
    /// One of a service that looks for people, or does not.
    pub fn new(people: Result<PeopleDesk, NoPeople>) -> Self {
        Self {
            people,
            view: Box::default(),
            names: Names::new(),
            failed: None,
            budget: Budget::new(Instant::now()),
        }
    }

    /// How long an order is waited for, other than usual.
    #[must_use]
    pub fn with_patience(mut self, patience: Duration) -> Self {
        if let Ok(people) = &mut self.people {
            people.desk.patience = patience;
        }
        self
    }

    /// Answers a request.
    pub fn answer(&mut self, request: &Request<'_>, from_here: bool) -> Response {
        let told =
            self.allowed(request, from_here)
                .and_then(|()| match (request.method, request.path) {
                    (Method::Get, PATH) => {
                        self.hear();
                        json(200, &self.tell()?)
                    }
                    (Method::Get, _) => Err((404, "ask for /people".to_owned())),
                    (Method::Post, _) => self.order(request),
                });
        told.unwrap_or_else(|(status, error)| {
            let body = serde_json::to_string(&ErrorStatus { error });
            Response::json(status, body.unwrap_or_default())
        })
    }

    fn allowed(&self, request: &Request<'_>, from_here: bool) -> Result<(), Refused> {
        if !from_here {
            let what = "people are told of, and ordered about, on the robot's computer alone: call \
                        from there, or through ssh -L 9470:127.0.0.1:9470";
            return Err((403, what.to_owned()));
        }
        guard::check(request).map_err(|refusal| (refusal.status(), refusal.to_string()))
    }

    /// Takes in what tracking and the keeper left, and lets go what went.
    pub fn hear(&mut self) {
        let Ok(people) = &mut self.people else { return };
        if let Some(newest) = people.views.full.receive() {
            let before = std::mem::replace(&mut self.view, newest);
            people.views.give_back(before);
        }
        if let Some(named) = &people.named {
            if let Some(names) = named.names.newest() {
                // Why an enrolment failed may hold the name of somebody who is forgotten now.
                let gone =
                    |(id, _): &(StoredId, String)| !names.iter().any(|(other, _)| other == id);
                if self.names.iter().any(gone) {
                    self.failed = None;
                }
                self.names = names;
            }
            self.failed = named.failures.newest().or(self.failed.take());
        }
    }

    fn name(&self, stored: Option<StoredId>) -> Option<String> {
        let named = self.names.iter().find(|(id, _)| Some(*id) == stored);
        named.map(|(_, name)| name.clone())
    }

    fn tell(&self) -> Result<People, Refused> {
        let people = self.people.as_ref().map_err(|why| none(*why))?;
        let now = people.clock.now();
        let View {
            picture,
            in_view,
            known,
            enrolment,
        } = &*self.view;
        Ok(People {
            picture: picture.map(|shown| PictureStatus {
                stamp_ns: shown.stamp.as_nanos(),
                age_s: now.secs_since(shown.stamp),
                width: shown.width,
                height: shown.height,
            }),
            in_view: in_view
                .iter()
                .map(|seen| InViewStatus {
                    track: seen.track,
                    bounding_box: BoxStatus {
                        left: seen.bounding_box.left,
                        top: seen.bounding_box.top,
                        width: seen.bounding_box.width,
                        height: seen.bounding_box.height,
                    },
                    confirmed: seen.confirmed,
                    unseen_s: seen.unseen_s,
                })
                .collect(),
            known: known
                .iter()
                .map(|known| KnownStatus {
                    number: known.number,
                    name: self.name(known.stored),
                    picked: known.picked,
                    condition: known.condition.name().to_owned(),
                    confidence: known.confidence,
                    track: known.track,
                    unseen_s: known.unseen_s,
                })
                .collect(),
            enrolment: enrolment.map(|progress| EnrolmentStatus {
                number: progress.number,
                stage: progress.stage,
                taken: progress.taken,
                wanted: enrolment::WANTED,
                left_s: match progress.stage.is_over() {
                    true => 0.0,
                    false => progress.ends.secs_since(now).max(0.0),
                },
                person: progress.person,
                advice: {
                    let failed = self.failed.as_ref().filter(|(n, _)| *n == progress.number);
                    advice(progress.stage, failed.map(|(_, why)| &**why))
                },
            }),
        })
    }

    fn order(&mut self, request: &Request<'_>) -> Result<Response, Refused> {
        self.hear();
        let order = self.understood(request)?;
        let people = self.people.as_mut().map_err(|why| none(*why))?;
        if !self.budget.spend(Instant::now()) {
            let what = "orders come too fast: send two a second at most";
            return Err((429, what.to_owned()));
        }
        let answer = people.desk.give(order);
        // By number: names are kept where they can be forgotten, which a log can't.
        info!(order = request.path, answer = ?answer, "an order about people");
        said(answer)
    }

    /// The order that a request is, as far as it can be carried out at all.
    fn understood(&self, request: &Request<'_>) -> Result<Order, Refused> {
        let people = self.people.as_ref().map_err(|why| none(*why))?;
        let order = match request.path {
            "/people/pick" => Order::Pick(pointed(&body(request)?)?),
            "/people/enrol" => Order::Enrol(body::<EnrolOrder>(request)?.name),
            "/people/cancel" => body::<BareOrder>(request).map(|_| Order::Cancel)?,
            "/people/release" => body::<BareOrder>(request).map(|_| Order::Release)?,
            _ => {
                let what = "there is no such order: pick, enrol, cancel and release are";
                return Err((404, what.to_owned()));
            }
        };
        if !people.tells_apart && matches!(order, Order::Pick(_) | Order::Enrol(_)) {
            let what = "no network tells people apart: name one as people.reid in the settings, and \
                        start the service again";
            return Err((503, what.to_owned()));
        }
        if let Order::Enrol(name) = &order {
            if people.named.is_none() {
                return Err(not_begun(NotBegun::NoStore));
            }
            let name = check_form_of_name(name).map_err(|error| (422, error.to_string()))?;
            if self.names.iter().any(|(_, taken)| taken == name) {
                let what = format!("somebody is called {name:?} already: choose another name");
                return Err((409, what));
            }
        }
        Ok(order)
    }
}

fn body<'a, T: Deserialize<'a>>(request: &Request<'a>) -> Result<T, Refused> {
    serde_json::from_slice(request.body)
        .map_err(|error| (400, format!("the order can't be read: {error}")))
}

fn pointed(order: &PickOrder) -> Result<Pointed, Refused> {
    match (order.track, order.at) {
        (Some(track), None) => Ok(Pointed::Track(track)),
        (None, Some(at)) if at.iter().all(|v| v.abs() < FARTHEST) => Ok(Pointed::Place(at)),
        (None, Some(_)) => Err((422, "no picture has such a place: give pixels".to_owned())),
        _ => Err((
            422,
            "give either track, a number, or at, a place in pixels".to_owned(),
        )),
    }
}

/// How many orders may come.
struct Budget {
    left: u32,
    since: Instant,
}

impl Budget {
    fn new(now: Instant) -> Self {
        Self {
            left: AT_ONCE,
            since: now,
        }
    }

    /// Whether one more may.
    fn spend(&mut self, now: Instant) -> bool {
        while self.left < AT_ONCE && now.duration_since(self.since) >= EVERY {
            self.left += 1;
            self.since += EVERY;
        }
        if self.left == AT_ONCE {
            self.since = now;
        }
        let may = self.left > 0;
        self.left = self.left.saturating_sub(1);
        may
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_orders_at_once_and_two_a_second() {
        let begun = Instant::now();
        let at = |ms: u64| begun + Duration::from_millis(ms);
        let mut budget = Budget::new(begun);
        let spent = (0..8).filter(|_| budget.spend(at(100))).count();
        assert_eq!(spent, 5);
        assert!(!budget.spend(at(599)));
        assert!(budget.spend(at(601)) && !budget.spend(at(602)));
        let spent = (0..100)
            .filter(|n| budget.spend(at(1000 + 100 * n)))
            .count();
        assert!((19..=21).contains(&spent), "{spent}");
        let later = (0..8).filter(|_| budget.spend(at(60_000))).count();
        assert_eq!(later, 5);
    }
}
