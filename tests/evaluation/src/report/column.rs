// SPDX-License-Identifier: MPL-2.0

//! The figures that tables have a column for.

use super::{
    bootstrap::{Interval, interval},
    judged::Judged,
};
use crate::metrics::{Metrics, mean};

/// One figure of a run.
pub struct Column {
    /// For machines.
    pub key: &'static str,
    /// For people.
    pub heading: &'static str,
    /// Digits after the point in tables.
    pub decimals: usize,
    /// What it is, of a run.
    pub value: fn(&Metrics) -> Option<f64>,
}

impl Column {
    /// The figure of a run or of the thesis.
    pub fn of(&self, metrics: &Metrics) -> Option<f64> {
        (self.value)(metrics)
    }

    /// Mean over those runs that have the figure.
    pub fn mean<'a>(&self, runs: impl IntoIterator<Item = &'a Metrics>) -> Option<f64> {
        mean(&runs.into_iter().filter_map(self.value).collect::<Vec<_>>())
    }

    /// The interval of that mean.
    pub fn interval<'a>(&self, runs: impl IntoIterator<Item = &'a Judged<'a>>) -> Option<Interval> {
        interval(runs.into_iter().filter_map(|one| Some((one.group(), self.of(&one.metrics)?))))
    }

    /// The mean with its interval, for people.
    pub fn show_with_interval(&self, runs: &[&Judged]) -> String {
        let mean = self.show(self.mean(runs.iter().map(|one| &one.metrics)));
        match self.interval(runs.iter().copied()) {
            Some(Interval { low, high }) => {
                format!("{mean} ({}–{})", self.show(Some(low)), self.show(Some(high)))
            }
            None => mean,
        }
    }

    /// For people; a dash where there is none.
    pub fn show(&self, value: Option<f64>) -> String {
        value.map_or_else(|| "—".into(), |value| format!("{value:.*}", self.decimals))
    }
}

fn percent(share: Option<f64>) -> Option<f64> {
    share.map(|share| share * 100.0)
}

/// Precision of the localisation.
pub const P: Column =
    Column { key: "precision_pct", heading: "P %", decimals: 1, value: |m| percent(m.precision) };
/// The same where predicted boxes count.
pub const P_PREDICTED: Column = Column {
    key: "precision_predicted_pct",
    heading: "P with predictions %",
    decimals: 1,
    value: |m| percent(m.precision_predicted),
};
/// Detection precision.
pub const DP: Column = Column {
    key: "detection_precision_pct",
    heading: "DP %",
    decimals: 1,
    value: |m| percent(m.detection_precision),
};
/// Track fragmentation.
pub const TF: Column = Column {
    key: "track_fragmentation_pct",
    heading: "TF %",
    decimals: 1,
    value: |m| percent(m.track_fragmentation),
};
/// Distance to the middle of the picture.
pub const MEAN_DGC: Column =
    Column { key: "mean_dgc", heading: "mean d_gc", decimals: 3, value: |m| m.mean_dgc };
/// Its variance.
pub const VAR_DGC: Column = Column { key: "var_dgc", heading: "var d_gc", decimals: 4, value: |m| m.var_dgc };
/// Distance to what is tracked.
pub const MEAN_DGP: Column =
    Column { key: "mean_dgp", heading: "mean d_gp", decimals: 3, value: |m| m.mean_dgp };
/// Its variance.
pub const VAR_DGP: Column = Column { key: "var_dgp", heading: "var d_gp", decimals: 4, value: |m| m.var_dgp };
/// Time until the person is in the middle.
pub const CENTRED: Column =
    Column { key: "centred_after_s", heading: "centred after s", decimals: 2, value: |m| m.centred_after_s };
/// Distance to the middle from then on.
pub const DGC_CENTRED: Column =
    Column { key: "mean_dgc_centred", heading: "d_gc then", decimals: 3, value: |m| m.mean_dgc_centred };
/// How often the person was lost.
pub const LOSSES: Column =
    Column { key: "losses", heading: "losses", decimals: 2, value: |m| m.losses.map(|losses| losses as f64) };
/// Time to acquire.
pub const ACQUIRE: Column = Column {
    key: "time_to_acquire_s",
    heading: "acquired after s",
    decimals: 2,
    value: |m| m.time_to_acquire_s,
};
/// Identity kept after full occlusions; of several runs the share.
pub const IDENTITY: Column = Column {
    key: "identity_kept_pct",
    heading: "identity kept %",
    decimals: 0,
    value: |m| percent(m.identity_kept.map(|kept| f64::from(u8::from(kept)))),
};
/// Commands a second.
pub const COMMANDS: Column =
    Column { key: "commands_per_s", heading: "commands/s", decimals: 1, value: |m| m.commands_per_s };
/// Switches to other people.
pub const SWITCHES: Column = Column {
    key: "identity_switches",
    heading: "switches",
    decimals: 0,
    value: |m| m.identity_switches.map(|switches| switches as f64),
};
/// Mean overlap.
pub const SUCCESS: Column =
    Column { key: "success_pct", heading: "IoU %", decimals: 1, value: |m| percent(m.success) };
/// Boxes in the right place.
pub const BOX_PRECISION: Column = Column {
    key: "box_precision_20px_pct",
    heading: "precision at 20 px %",
    decimals: 1,
    value: |m| percent(m.box_precision),
};

/// What the thesis gives too.
pub const OF_THESIS: [Column; 7] = [P, DP, TF, MEAN_DGC, VAR_DGC, MEAN_DGP, VAR_DGP];

/// For runs in the room.
pub const OF_TESTS: [Column; 15] = [
    P,
    DP,
    TF,
    MEAN_DGC,
    VAR_DGC,
    MEAN_DGP,
    VAR_DGP,
    P_PREDICTED,
    SUCCESS,
    CENTRED,
    DGC_CENTRED,
    LOSSES,
    ACQUIRE,
    IDENTITY,
    COMMANDS,
];

/// For the summary.
pub const OF_SUMMARY: [Column; 9] = [P, P_PREDICTED, DP, TF, SUCCESS, MEAN_DGC, CENTRED, DGC_CENTRED, LOSSES];

/// Where a mean without an interval would say too much.
pub const WITH_INTERVAL: [Column; 4] = [DP, TF, SUCCESS, MEAN_DGC];

/// Everything.
pub const ALL: [Column; 17] = [
    P,
    DP,
    TF,
    MEAN_DGC,
    VAR_DGC,
    MEAN_DGP,
    VAR_DGP,
    P_PREDICTED,
    SUCCESS,
    CENTRED,
    DGC_CENTRED,
    LOSSES,
    ACQUIRE,
    IDENTITY,
    COMMANDS,
    SWITCHES,
    BOX_PRECISION,
];
