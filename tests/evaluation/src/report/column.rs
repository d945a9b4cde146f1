//! The figures that tables have a column for.

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
    Column { key: "success_pct", heading: "success %", decimals: 1, value: |m| percent(m.success) };
/// Boxes in the right place.
pub const BOX_PRECISION: Column = Column {
    key: "box_precision_20px_pct",
    heading: "precision at 20 px %",
    decimals: 1,
    value: |m| percent(m.box_precision),
};

/// Pictures that never reached the tracker; only in real time.
pub const DROPPED: Column =
    Column { key: "dropped_pct", heading: "dropped %", decimals: 1, value: |m| percent(m.dropped) };

/// What the thesis gives too.
pub const OF_THESIS: [Column; 7] = [P, DP, TF, MEAN_DGC, VAR_DGC, MEAN_DGP, VAR_DGP];

/// For runs in the room.
pub const OF_TESTS: [Column; 10] =
    [P, DP, TF, MEAN_DGC, VAR_DGC, MEAN_DGP, VAR_DGP, ACQUIRE, IDENTITY, COMMANDS];

/// Everything.
pub const ALL: [Column; 14] = [
    P,
    DP,
    TF,
    MEAN_DGC,
    VAR_DGC,
    MEAN_DGP,
    VAR_DGP,
    ACQUIRE,
    IDENTITY,
    COMMANDS,
    SWITCHES,
    SUCCESS,
    BOX_PRECISION,
    DROPPED,
];
