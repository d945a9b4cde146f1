// SPDX-License-Identifier: MPL-2.0

//! Stratum by stratum: better, worse or not told apart.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    path::Path,
};

use super::{
    read::{CompareError, ENDPOINTS, Figures, Key, Report},
    statistics::{Detectable, clopper_pearson, detectable, holm, sign_flip, signed_ranks},
};
use crate::metrics::mean;

/// As often as this, at most, any of a comparison's verdicts is wrong.
const LEVEL: f64 = 0.05;
/// What all scenes together are called, where there are several strata: a small difference that is everywhere shows in them.
const ALL: &str = "all strata";

/// An endpoint as it is shown.
struct Endpoint {
    name: &'static str,
    decimals: usize,
    more_is_better: bool,
}

/// In the order of [`Figures::endpoints`].
const ENDPOINT: [Endpoint; ENDPOINTS] = [
    Endpoint { name: "held %", decimals: 1, more_is_better: true },
    Endpoint { name: "off by, d_gc", decimals: 3, more_is_better: false },
    Endpoint { name: "changes a minute", decimals: 2, more_is_better: false },
    Endpoint { name: "pursuits an hour", decimals: 0, more_is_better: false },
];

/// What is said of a stratum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The second is, in an endpoint, and worse in none.
    Better,
    /// The second is, in an endpoint.
    Worse,
    /// Chance alone may have made the difference.
    NotToldApart,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Better => "better",
            Self::Worse => "worse",
            Self::NotToldApart => "not told apart",
        })
    }
}

/// One stratum of a comparison.
#[derive(Debug, Clone)]
pub struct Compared {
    /// Suite and stratum.
    pub name: (String, String),
    /// What is said of it.
    pub verdict: Verdict,
    pairs: Vec<(Figures, Figures)>,
    /// Of each endpoint, corrected for all endpoints and strata.
    probabilities: [f64; ENDPOINTS],
    /// Its share of the level.
    weight: f64,
}

/// All strata of a comparison.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// In the order of their names, all of them together first.
    pub strata: Vec<Compared>,
}

/// Sets the report in folder `b` against that in `a`.
///
/// # Errors
/// Where a report cannot be read, or they are not comparable.
pub fn compare(a: &Path, b: &Path) -> Result<Comparison, CompareError> {
    let (a, b) = (Report::read(a)?, Report::read(b)?);
    if a.generator != b.generator {
        return Err(CompareError::Generator(a.generator, b.generator));
    }
    let comparison = Comparison::of(&a.averaged(), &b.averaged());
    if comparison.strata.is_empty() { Err(CompareError::Nothing) } else { Ok(comparison) }
}

impl Comparison {
    /// Of the scenes that both have.
    pub fn of(before: &BTreeMap<Key, Figures>, after: &BTreeMap<Key, Figures>) -> Self {
        let mut strata = BTreeMap::<(String, String), Vec<(Figures, Figures)>>::new();
        let stratum: BTreeSet<&String> = before.keys().map(|(_, stratum, ..)| stratum).collect();
        for (key, before) in before {
            let Some(after) = after.get(key) else { continue };
            let together = (stratum.len() > 1).then_some(ALL);
            for name in [key.1.as_str()].into_iter().chain(together) {
                strata.entry((key.0.clone(), name.to_owned())).or_default().push((*before, *after));
            }
        }
        let found: Vec<_> = strata.values().map(|pairs| sign_flip(&differences(pairs))).collect();
        let weights = weights(strata.keys().map(|(_, name)| name == ALL).collect());
        let least: Vec<_> = found.iter().map(|all| all.iter().copied().fold(1.0, f64::min)).collect();
        let corrected = holm(&least.iter().copied().zip(weights.iter().copied()).collect::<Vec<_>>());
        let strata = strata.into_iter().enumerate().map(|(index, (name, pairs))| {
            // What the correction does to the least of a stratum's probabilities it does to all of them.
            let factor = if least[index] > 0.0 { corrected[index] / least[index] } else { 1.0 };
            let probabilities = found[index].map(|probability| (probability * factor).min(1.0));
            let (verdict, weight) = (verdict(&pairs, &probabilities), weights[index]);
            Compared { verdict, name, pairs, probabilities, weight }
        });
        Self { strata: strata.collect() }
    }

    /// Whether anything is told apart.
    pub fn tells(&self) -> bool {
        self.strata.iter().any(|one| one.verdict != Verdict::NotToldApart)
    }

    /// What is to be done by the rule that a change is kept if one stratum is better and none is worse.
    fn conclusion(&self) -> &'static str {
        let any = |verdict| self.strata.iter().any(|one| one.verdict == verdict);
        match (any(Verdict::Better), any(Verdict::Worse)) {
            (true, false) => "Better: at least one stratum is, and none is worse.",
            (_, true) => "Worse: at least one stratum is.",
            (false, false) => "Not told apart in any stratum.",
        }
    }
}

/// Shares of the level: half of it is for all strata together, the rest for each alike.
fn weights(together: Vec<bool>) -> Vec<f64> {
    let all = together.iter().filter(|one| **one).count();
    let each = together.len() - all;
    let weight = |one: &bool| match (one, all) {
        (true, _) => 0.5 / all as f64,
        (false, 0) => 1.0 / each as f64,
        (false, _) => 0.5 / each as f64,
    };
    together.iter().map(weight).collect()
}

fn differences(pairs: &[(Figures, Figures)]) -> Vec<[Option<f64>; ENDPOINTS]> {
    let difference = |(before, after): &(Figures, Figures)| {
        std::array::from_fn(|index| Some(after.endpoints[index]? - before.endpoints[index]?))
    };
    pairs.iter().map(difference).collect()
}

fn column(pairs: &[(Figures, Figures)], index: usize) -> Vec<f64> {
    differences(pairs).into_iter().filter_map(|row| row[index]).collect()
}

/// An endpoint is told only where its mean difference goes the way that most of its ranks go: one person lost is not made up for by
/// many who are held a little better.
fn verdict(pairs: &[(Figures, Figures)], probabilities: &[f64; ENDPOINTS]) -> Verdict {
    let told = (0..ENDPOINTS).filter(|index| probabilities[*index] <= LEVEL).filter_map(|index| {
        let differences = column(pairs, index);
        let (mean, ranks) = (mean(&differences)?, signed_ranks(&differences).iter().sum::<f64>());
        (mean * ranks > 0.0).then_some((mean > 0.0) == ENDPOINT[index].more_is_better)
    });
    let better: BTreeSet<bool> = told.collect();
    match (better.contains(&true), better.contains(&false)) {
        (_, true) => Verdict::Worse,
        (true, false) => Verdict::Better,
        (false, false) => Verdict::NotToldApart,
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = ENDPOINT.iter().map(|endpoint| endpoint.name).collect();
        writeln!(f, "| stratum | scenes | second to first | {} | scenes with a loss |", names.join(" | "))?;
        writeln!(f, "|---|---:|---|{}---|", "---|".repeat(ENDPOINTS))?;
        for one in &self.strata {
            let cells: Vec<_> = (0..ENDPOINTS).map(|index| one.cell(index)).collect();
            let (suite, stratum) = &one.name;
            writeln!(
                f,
                "| {stratum}, {suite} | {} | {} | {} | {} |",
                one.pairs.len(),
                one.verdict,
                cells.join(" | "),
                one.losses()
            )?;
        }
        writeln!(
            f,
            "\n{}\nFirst → second; p by sign flips over scenes, corrected for endpoints and strata (told apart at 0.05); after ≥ the \
             smallest difference that would have been seen in 80 of 100 cases. Losses: of scenes, with exact 95 % limits.",
            self.conclusion()
        )
    }
}

impl Compared {
    fn cell(&self, index: usize) -> String {
        let of = |which: fn(&(Figures, Figures)) -> Figures| {
            mean(&self.pairs.iter().filter_map(|pair| which(pair).endpoints[index]).collect::<Vec<_>>())
        };
        let Some((before, after)) = of(|pair| pair.0).zip(of(|pair| pair.1)) else { return "—".into() };
        let decimals = ENDPOINT[index].decimals;
        // The first of Holm's steps, which all have to pass if only one is to be told.
        let alpha = LEVEL * self.weight / ENDPOINTS as f64;
        let seen = match detectable(&column(&self.pairs, index), alpha) {
            Some(Detectable::Difference(least)) => format!(", ≥ {least:.decimals$}"),
            Some(Detectable::Scenes(scenes)) => format!(", ≥ {scenes} scenes"),
            None => String::new(),
        };
        format!("{before:.decimals$} → {after:.decimals$}, p {:.3}{seen}", self.probabilities[index])
    }

    fn losses(&self) -> String {
        let count = |which: fn(&(Figures, Figures)) -> f64| {
            let count = self.pairs.iter().filter(|pair| which(pair) > 0.0).count();
            let (low, high) = clopper_pearson(count, self.pairs.len());
            format!("{count} ({:.0}–{:.0} %)", 100.0 * low, 100.0 * high)
        };
        format!("{} → {}", count(|pair| pair.0.lost), count(|pair| pair.1.lost))
    }
}
