//! `tracking`: who is where from picture to picture, and which of them the robot knows.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use hachi_hal::{Clock, Stamp};
use hachi_people::identify::Condition;
use hachi_people::watch::Watch;
use hachi_runtime::{Histogram, Progress, TaskClock, Work};
use tracing::info;

use super::messages::{BeltEnd, Looked};
use super::reception::Reception;
use super::signs::SharedSigns;

/// Somebody who sees what the robot sees, and may point at a person.
pub trait Audience: Send {
    /// What was made of a picture. Where the user points in it, pixels, if they do.
    fn see(&mut self, looked: &Looked, watch: &Watch) -> Option<[f64; 2]>;
}

/// The task.
pub struct Tracking {
    /// Who is where.
    pub watch: Watch,
    /// From detection.
    pub looked: BeltEnd<Looked>,
    /// Time of the last picture.
    pub last: Option<Stamp>,
    /// Whom it knows, and what others want of it.
    pub reception: Reception,
    /// Who sees it.
    pub audience: Option<Box<dyn Audience>>,
    /// From the middle of the exposure to where the robot's people are.
    pub latency: Arc<Histogram>,
    /// The clock that it is measured on.
    pub clock: TaskClock,
    /// What the task leaves for whoever asks.
    pub signs: SharedSigns,
    /// What was last said of the robot's person, or the first whom it knows: number and condition.
    pub said: Option<(u32, Condition)>,
}

impl Work for Tracking {
    fn run(&mut self, _: Stamp) -> Progress {
        self.reception.hear(&mut self.watch, self.clock.now());
        if let Some(looked) = self.looked.full.receive() {
            self.see(&looked);
            self.looked.give_back(looked);
        }
        self.reception.tell(&self.watch);
        Progress::Done
    }
}

impl Tracking {
    /// Takes in a picture.
    fn see(&mut self, looked: &Looked) {
        let stamp = looked.picture.stamp;
        let dt_s = self.last.map_or(0.0, |last| stamp.secs_since(last));
        self.last = Some(stamp);
        self.reception.hold(&mut self.watch);
        self.watch.step(&looked.observation(), dt_s);
        let now = self.clock.now();
        self.reception.see(&mut self.watch, looked, now);
        self.latency.record_signed_ns(now.nanos_since(stamp));
        self.tell();
        if let Some(audience) = &mut self.audience
            && let Some(at) = audience.see(looked, &self.watch)
        {
            self.watch.pick(at);
        }
    }

    /// Leaves what is known, and says what changed.
    fn tell(&mut self) {
        let tracks = self.watch.tracks().iter();
        let in_view = tracks.filter(|track| track.is_confirmed() && track.is_seen());
        let in_view = u32::try_from(in_view.count()).unwrap_or(u32::MAX);
        self.signs.people_in_view.store(in_view, Ordering::Relaxed);
        let first = self.reception.roster.first().copied();
        let said = first.and_then(|known| {
            let status = self.watch.statuses().find(|s| s.person == known.person)?;
            Some((known.number, status.condition))
        });
        if said == self.said {
            return;
        }
        self.said = said;
        let name = said.map_or("", |(_, condition)| condition.name());
        self.signs.person.set(name);
        if let Some((number, _)) = said {
            // By number: names are kept where they can be forgotten, which a log can't.
            info!(condition = name, "person {number}");
        }
    }
}

#[cfg(test)]
mod tests {
    use std::thread::JoinHandle;
    use std::time::Duration;

    use hachi_people::identify::IdentifierConfig;
    use hachi_people::pointing::Pointed;
    use hachi_runtime::{TaskTable, VirtualClock};

    use super::super::messages::{Belt, belt};
    use super::super::orders::{Answer, Desk, Order, orders};
    use super::super::test_people::{observation, person_at};
    use super::super::view::View;
    use super::*;

    /// Tracking with the eyes of a test: ten pictures a second of people in the same clothes.
    struct Rig {
        tracking: Tracking,
        looked: Belt<Looked>,
        views: BeltEnd<View>,
        clock: VirtualClock,
        desk: Option<Desk>,
        now: Stamp,
    }

    impl Rig {
        fn new() -> Self {
            let now = Stamp::from_nanos(1);
            let clock = VirtualClock::starting_at(now);
            let table = TaskTable::new(TaskClock::new(clock.clone()));
            let nobody = table.bell();
            let (looked, looked_end) = belt::<Looked>(&table, "looked at", 2, &nobody);
            let (views, views_end) = belt::<View>(&table, "views", 1, &nobody);
            let (desk, inbox) = orders(&nobody, &nobody, Duration::from_secs(60));
            let signs = SharedSigns::default();
            let reception = Reception::new(inbox, views, Arc::clone(&signs));
            let tracking = Tracking {
                watch: Watch::new(0.5, IdentifierConfig::default()),
                looked: looked_end,
                last: None,
                reception,
                audience: None,
                latency: Arc::default(),
                clock: table.clock().clone(),
                signs,
                said: None,
            };
            Self {
                tracking,
                looked,
                views: views_end,
                clock,
                desk: Some(desk),
                now,
            }
        }

        fn see(&mut self, lefts: &[f64]) {
            self.now = self.now + 100_000_000;
            self.clock.advance_to(self.now);
            let detections: Vec<_> = lefts.iter().map(|left| person_at(*left, 0.0)).collect();
            let mut looked = self.looked.empty.receive().unwrap();
            looked.picture.stamp = self.now;
            looked.keep(&observation(&detections, &[1.0, 0.1].repeat(lefts.len())));
            self.looked.send(looked);
            self.tracking.run(self.now);
        }

        /// What becomes of an order while these people are seen.
        fn give(&mut self, order: Order, lefts: &[f64]) -> Answer {
            let mut desk = self.desk.take().unwrap();
            let giving: JoinHandle<_> = std::thread::spawn(move || {
                let answer = desk.give(order);
                (desk, answer)
            });
            while !giving.is_finished() {
                self.see(lefts);
                std::thread::sleep(Duration::from_millis(1));
            }
            let (desk, answer) = giving.join().unwrap();
            self.desk = Some(desk);
            answer.unwrap()
        }

        fn view(&mut self) -> Box<View> {
            self.views.full.receive().unwrap()
        }
    }

    #[test]
    fn an_order_says_which_of_two_alike_is_the_person_where_the_robot_is_unsure() {
        let mut rig = Rig::new();
        for _ in 0..5 {
            rig.see(&[0.0, 300.0]);
        }
        let pick = Order::Pick(Pointed::Place([20.0, 50.0]));
        let Answer::Picked { person, known, .. } = rig.give(pick, &[0.0, 300.0]) else {
            panic!("not picked");
        };
        assert_eq!((person, known), (1, false));
        // They meet, one hides the other for a moment, and they part again.
        for k in 0..26 {
            rig.see(&[f64::from(k) * 10.0, 300.0]);
        }
        for _ in 0..5 {
            rig.see(&[300.0]);
        }
        for k in 0..20 {
            rig.see(&[280.0 - 10.0 * f64::from(k), 300.0]);
        }
        let view = rig.view();
        let known = view.known[0];
        assert!(matches!(
            known.condition,
            Condition::Unsure | Condition::Searching
        ));
        rig.views.give_back(view);
        let pick = Order::Pick(Pointed::Place([110.0, 50.0]));
        let answer = rig.give(pick, &[90.0, 300.0]);
        assert!(
            matches!(
                answer,
                Answer::Picked {
                    person: 1,
                    known: true,
                    ..
                }
            ),
            "{answer:?}"
        );
        for _ in 0..5 {
            rig.see(&[90.0, 300.0]);
        }
        let view = rig.view();
        let [known] = view.known[..] else {
            panic!("{view:?}");
        };
        assert_eq!((known.condition, known.number), (Condition::Seen, 1));
        let on = view
            .in_view
            .iter()
            .find(|seen| Some(seen.track) == known.track);
        assert!((on.unwrap().bounding_box.left - 90.0).abs() < 10.0);
        assert!(known.picked);
    }

    #[test]
    fn orders_are_carried_out_in_turn_and_the_view_follows() {
        let mut rig = Rig::new();
        assert_eq!(rig.give(Order::Release, &[0.0]), Answer::Released(None));
        assert_eq!(rig.give(Order::Cancel, &[0.0]), Answer::Cancelled(false));
        for _ in 0..5 {
            rig.see(&[0.0]);
        }
        let track = rig.tracking.watch.tracks()[0].id;
        let picked = rig.give(Order::Pick(Pointed::Track(track)), &[0.0]);
        assert!(
            matches!(picked, Answer::Picked { person: 1, .. }),
            "{picked:?}"
        );
        assert_eq!(rig.give(Order::Release, &[0.0]), Answer::Released(Some(1)));
        rig.see(&[0.0]);
        let view = rig.view();
        assert_eq!((view.known.len(), view.in_view.len()), (0, 1));
        assert_eq!(rig.tracking.watch.statuses().count(), 0);
    }
}
