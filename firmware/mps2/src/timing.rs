//! What ticks by the sample clock take, and which came late.

use crate::timer;
use hysteron_firmware::wire::Summary;

/// An entry of the sample clock's interrupt.
#[derive(Clone, Copy)]
pub struct Entry {
    /// Timer counts since the edge.
    elapsed: u32,
    /// The second counter at the edge.
    edge: u32,
}

impl Entry {
    /// First statement of the interrupt: the next edge counts from here on.
    #[inline(always)]
    pub fn now() -> Self {
        let elapsed = timer::elapsed();
        let edge = timer::count().wrapping_sub(elapsed);
        timer::acknowledge();
        Self { elapsed, edge }
    }
}

/// Counts over a run.
pub struct Timing {
    done: u32,
    /// The second counter at the last edge.
    edge: u32,
    summary: Summary,
}

impl Default for Timing {
    fn default() -> Self {
        let summary = Summary {
            latency_min: u32::MAX,
            tick_min: u32::MAX,
            ..Summary::default()
        };
        Self {
            done: 0,
            edge: 0,
            summary,
        }
    }
}

impl Timing {
    /// Ticks done.
    pub fn done(&self) -> u32 {
        self.done
    }

    /// The counts so far.
    pub fn summary(&self) -> &Summary {
        &self.summary
    }

    /// A tick that began with `entry` and took `cost` timer counts, one that `starts` a run or another; edges that no tick belongs to are
    /// lost.
    #[inline(always)]
    pub fn tick(&mut self, entry: Entry, cost: u32, starts: bool) {
        let summary = &mut self.summary;
        if self.done > 0 {
            let edges = (entry.edge.wrapping_sub(self.edge) + timer::PERIOD / 2) / timer::PERIOD;
            summary.lost += edges.saturating_sub(1);
        }
        self.edge = entry.edge;
        summary.latency_min = summary.latency_min.min(entry.elapsed);
        summary.latency_max = summary.latency_max.max(entry.elapsed);
        summary.tick_min = summary.tick_min.min(cost);
        summary.tick_max = summary.tick_max.max(cost);
        if !starts {
            summary.running_max = summary.running_max.max(cost);
        }
        summary.tick_sum += u64::from(cost);
        self.done += 1;
    }

    /// The end of the interrupt: whether the next edge has come already, which is an overrun.
    #[inline(always)]
    pub fn late(&mut self) -> bool {
        let late = timer::pending();
        if late {
            self.summary.overruns += 1;
        }
        late
    }
}
