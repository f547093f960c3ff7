//! Telemetry and health as Prometheus reads them (text format 0.0.4).

use std::fmt::Write;

use crate::health::{Health, HealthState, Trouble};
use crate::histogram::Histogram;
use crate::telemetry::Telemetry;

/// All metrics.
pub fn text(telemetry: &Telemetry, health: &Health) -> String {
    let mut out = Page::default();
    out.tasks(telemetry);
    out.health(health);
    out.0
}

#[derive(Default)]
struct Page(String);

impl Page {
    fn heading(&mut self, name: &str, kind: &str, help: &str) {
        // Writing to a String can't fail.
        let _ = writeln!(self.0, "# HELP {name} {help}\n# TYPE {name} {kind}");
    }

    fn line(&mut self, name: &str, labels: &str, value: f64) {
        let _ = writeln!(self.0, "{name}{{{labels}}} {value}");
    }

    /// Percentiles, sum and count of times in seconds. Names of tasks and queues are words of this
    /// program: nothing in them needs escaping.
    fn summary(&mut self, name: &str, label: &str, times: &Histogram) {
        for share in [0.5, 0.99, 0.999, 1.0] {
            let labels = format!("{label},quantile=\"{share}\"");
            self.line(name, &labels, times.percentile_ns(share) * 1e-9);
        }
        self.line(&format!("{name}_sum"), label, times.sum_s());
        self.line(&format!("{name}_count"), label, times.runs() as f64);
    }

    fn tasks(&mut self, telemetry: &Telemetry) {
        let name = "hachi_task_execution_seconds";
        self.heading(name, "summary", "How long runs of a task took.");
        for (spec, record) in telemetry.tasks() {
            self.summary(name, &format!("task=\"{}\"", spec.name), &record.execution);
        }
        let name = "hachi_task_release_jitter_seconds";
        self.heading(name, "summary", "How long after its release a run began.");
        for (spec, record) in telemetry.tasks() {
            self.summary(name, &format!("task=\"{}\"", spec.name), &record.jitter);
        }
        type Read = fn(&crate::telemetry::TaskRecord) -> f64;
        let counts: [(&str, &str, &str, Read); 3] = [
            (
                "hachi_task_overruns_total",
                "counter",
                "Runs that took longer than the budget.",
                |record| record.overruns() as f64,
            ),
            (
                "hachi_task_skipped_total",
                "counter",
                "Releases that passed while a run was under way.",
                |record| record.skipped() as f64,
            ),
            (
                "hachi_task_level",
                "gauge",
                "Steps of its ladder that a task leaves out.",
                |record| record.level() as f64,
            ),
        ];
        for (name, kind, help, read) in counts {
            self.heading(name, kind, help);
            for (spec, record) in telemetry.tasks() {
                self.line(name, &format!("task=\"{}\"", spec.name), read(record));
            }
        }
        let name = "hachi_queue_dropped_total";
        self.heading(
            name,
            "counter",
            "Values that had to go because a queue was full.",
        );
        for (task, queue) in telemetry.queues() {
            let labels = format!("task=\"{task}\",queue=\"{}\"", queue.name());
            self.line(name, &labels, queue.dropped() as f64);
        }
        let name = "hachi_latency_seconds";
        self.heading(name, "summary", "Time from one end to the other.");
        for (latency, times) in telemetry.latencies() {
            self.summary(name, &format!("path=\"{latency}\""), times);
        }
    }

    fn health(&mut self, health: &Health) {
        let name = "hachi_health";
        self.heading(name, "gauge", "1 for the state that the service is in.");
        let now = health.state();
        for state in HealthState::ALL {
            let labels = format!("state=\"{}\"", state.name());
            self.line(name, &labels, f64::from(u8::from(state == now)));
        }
        let name = "hachi_trouble";
        self.heading(name, "gauge", "1 for what is wrong.");
        for trouble in Trouble::ALL {
            let labels = format!("trouble=\"{}\"", trouble.name());
            self.line(name, &labels, f64::from(u8::from(health.has(trouble))));
        }
    }
}
