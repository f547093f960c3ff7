//! Tasks in virtual time: order, budgets, queues, and the same bytes every time.

mod rows;

use std::sync::{Arc, Mutex};

use hachi_hal::Stamp;
use hachi_runtime::executor::virtual_time::VirtualTime;
use hachi_runtime::{
    Overrun, Progress, TaskClock, TaskSpec, TaskTable, Trouble, VirtualClock, WhenFull, bounded,
};
use rows::{MS, by_input, by_period};

fn table() -> (VirtualClock, TaskTable) {
    let clock = VirtualClock::starting_at(Stamp::from_nanos(1_000 * MS));
    (clock.clone(), TaskTable::new(TaskClock::new(clock)))
}

fn after(ms: i64) -> Stamp {
    Stamp::from_nanos((1_000 + ms) * MS)
}

type Log = Arc<Mutex<Vec<(&'static str, i64)>>>;

/// A task that writes down when it runs.
fn noting(log: &Log, name: &'static str) -> Box<dyn hachi_runtime::Work> {
    let log = Arc::clone(log);
    Box::new(move |now: Stamp| {
        log.lock()
            .unwrap()
            .push((name, now.nanos_since(after(0)) / MS));
        Progress::Done
    })
}

#[test]
fn tasks_run_in_time_and_at_one_time_by_priority() {
    let (clock, mut table) = table();
    let log = Log::default();
    for (name, period, priority) in [("slow", 20, 10), ("fast", 10, 20), ("also fast", 10, 20)] {
        let spec = by_period(name, period, priority);
        table.add(spec, table.bell(), vec![], noting(&log, name));
    }
    let mut run = VirtualTime::new(table, clock);
    run.run_until(after(25));
    let expected = [
        ("fast", 0),
        ("also fast", 0),
        ("slow", 0),
        ("fast", 10),
        ("also fast", 10),
        ("fast", 20),
        ("also fast", 20),
        ("slow", 20),
    ];
    assert_eq!(*log.lock().unwrap(), expected);
}

#[test]
fn input_releases_a_task_at_the_moment_it_comes() {
    let (clock, mut table) = table();
    let log = Log::default();
    let bell = table.bell();
    let (sender, receiver) = bounded("numbers", 2, WhenFull::DropOldest, &bell);
    let spec = by_period("source", 10, 5);
    let source = move |_| {
        let _ = sender.send(1);
        Progress::Done
    };
    table.add(spec, table.bell(), vec![], Box::new(source));
    let gauge = receiver.gauge();
    let (note, taken) = (Arc::clone(&log), receiver);
    let sink = move |now: Stamp| {
        let value = taken.receive().unwrap();
        let at = now.nanos_since(after(0)) / MS;
        note.lock().unwrap().push(("sink", at + value - 1));
        Progress::Done
    };
    table.add(by_input("sink", 10, 50), bell, vec![gauge], Box::new(sink));
    let mut run = VirtualTime::new(table, clock);
    run.run_until(after(21));
    assert_eq!(
        *log.lock().unwrap(),
        [("sink", 0), ("sink", 10), ("sink", 20)]
    );
}

/// A task that can say at which step it works.
struct Stepping(Arc<Mutex<Vec<usize>>>, usize);

impl hachi_runtime::Work for Stepping {
    fn run(&mut self, _: Stamp) -> Progress {
        self.0.lock().unwrap().push(self.1);
        Progress::Done
    }
    fn degrade(&mut self, level: usize) {
        self.1 = level;
    }
}

#[test]
fn a_slow_task_leaves_out_step_by_step_and_climbs_back() {
    let (clock, mut table) = table();
    let levels = Arc::new(Mutex::new(Vec::new()));
    let spec = TaskSpec {
        overrun: Overrun::Degrade,
        ladder: &["coarser", "less"],
        ..by_period("mapping", 10, 5)
    };
    let health = table.health().clone();
    health.started();
    let work = Stepping(Arc::clone(&levels), 0);
    table.add(spec, table.bell(), vec![], Box::new(work));
    // Too slow for the first 100 ms, with whatever it leaves out.
    let cost = |spec: &TaskSpec, now: Stamp| match now < after(100) {
        true => spec.budget_ns + 1,
        false => spec.budget_ns,
    };
    let mut run = VirtualTime::new(table, clock).with_cost(Box::new(cost));
    run.run_until(after(100));
    let row = &run.telemetry().rows()[0];
    assert_eq!((row.overruns, row.level), (10, 2));
    assert_eq!(row.leaves_out, ["coarser", "less"]);
    assert!(health.has(Trouble::TaskDegraded));
    run.run_until(after(1_200));
    let levels = levels.lock().unwrap();
    // Three overruns, three more; then fifty good runs for each step up.
    assert_eq!(levels[..7], [0, 0, 0, 1, 1, 1, 2]);
    assert_eq!(levels[59..61], [2, 1]);
    assert_eq!(levels[109..111], [1, 0]);
    assert!(!health.has(Trouble::TaskDegraded));
}

#[test]
fn an_overrun_of_a_task_that_may_not_holds_the_robot_until_it_keeps_its_budget_again() {
    let (clock, mut table) = table();
    let halt = table.halt().clone();
    let spec = TaskSpec {
        overrun: Overrun::Stop,
        ..by_period("base command", 10, 90)
    };
    table.add(spec, table.bell(), vec![], Box::new(|_| Progress::Done));
    let cost = |spec: &TaskSpec, now: Stamp| match now == after(20) {
        true => spec.budget_ns + 1,
        false => 0,
    };
    let mut run = VirtualTime::new(table, clock).with_cost(Box::new(cost));
    run.run_until(after(15));
    assert!(!halt.is_asked_for());
    run.run_until(after(25));
    assert!(halt.is_asked_for());
    run.run_until(after(515));
    assert!(halt.is_asked_for(), "49 good runs are not enough");
    run.run_until(after(525));
    assert!(!halt.is_asked_for());
}

#[test]
fn a_task_slower_than_its_input_loses_the_oldest_and_says_how_many() {
    let (clock, mut table) = table();
    let bell = table.bell();
    let (sender, receiver) = bounded("scans", 2, WhenFull::DropOldest, &bell);
    let mut next = 0;
    let source = move |_| {
        let _ = sender.send(next);
        next += 1;
        Progress::Done
    };
    table.add(
        by_period("lidar", 10, 50),
        table.bell(),
        vec![],
        Box::new(source),
    );
    let seen = Arc::new(Mutex::new(Vec::new()));
    let (gauge, note) = (receiver.gauge(), Arc::clone(&seen));
    let sink = move |_| {
        note.lock().unwrap().extend(receiver.receive());
        match receiver.is_empty() {
            true => Progress::Done,
            false => Progress::More,
        }
    };
    table.add(
        by_input("odometry", 10, 5),
        bell,
        vec![gauge],
        Box::new(sink),
    );
    // Takes 25 ms for each, every 10 ms one comes.
    let cost = |spec: &TaskSpec, _| i64::from(spec.name == "odometry") * 25 * MS;
    let mut run = VirtualTime::new(table, clock).with_cost(Box::new(cost));
    run.run_until(after(200));
    let row = &run.telemetry().rows()[1];
    let seen = seen.lock().unwrap();
    assert!(seen.windows(2).all(|pair| pair[0] < pair[1]), "{seen:?}");
    assert_eq!(seen.len(), 8, "one every 25 ms: {seen:?}");
    // 20 came; what was not seen and does not wait was dropped.
    assert_eq!(row.dropped, 20 - 8 - row.queued as u64);
    assert_eq!(row.overruns, 8);
}
