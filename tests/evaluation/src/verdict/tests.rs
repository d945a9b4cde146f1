// SPDX-License-Identifier: MPL-2.0

use std::{collections::BTreeMap, path::Path};

use proptest::prelude::*;
use virtual_camera::Seeded;

use super::{
    calibration::told,
    read::{Figures, Key, Report},
    statistics::Detectable,
    *,
};

fn near(found: f64, expected: f64, error: f64) {
    assert!((found - expected).abs() <= error, "{found} instead of {expected}");
}

fn alone(differences: &[f64]) -> f64 {
    sign_flip(&differences.iter().map(|one| [Some(*one)]).collect::<Vec<_>>())[0]
}

#[test]
fn sign_flips_of_a_few_are_counted_out() {
    // All the same way: two of 2^n.
    near(alone(&[1.0, 2.0, 3.0, 4.0, 5.0]), 2.0 / 32.0, 1e-12);
    // Sums as far from 0 as 3 + 2 − 1: of ±1 ±2 ±3 these are 6, 4, −4 and −6.
    near(alone(&[30.0, 0.2, -0.1]), 4.0 / 8.0, 1e-12);
    // One that is lost is one of ten, however far.
    let small = [0.1, 0.2, 0.15, 0.12, 0.18, 0.11, 0.13, 0.16, 0.14];
    near(alone(&[&small[..], &[80.0]].concat()), 2.0 / 1024.0, 1e-12);
    assert_eq!(alone(&[0.0, 0.0]), 1.0);
    assert_eq!(alone(&[]), 1.0);
}

/// Charles Darwin's differences between crossed and self-fertilised maize, eighths of an inch (Fisher, "The Design of Experiments",
/// section 17): ranks 14 and 10 go the other way, and of 2^15 sums of ranks 676 are as small.
#[test]
fn sign_flips_of_ranks_find_what_is_known_of_darwin_s_maize() {
    let darwin = [49.0, -67.0, 8.0, 16.0, 6.0, 23.0, 28.0, 41.0, 14.0, 29.0, 56.0, 24.0, 75.0, 60.0, -48.0];
    near(alone(&darwin), 2.0 * 676.0 / 32768.0, 0.004);
}

#[test]
fn many_endpoints_are_paid_for_only_as_far_as_they_differ() {
    let rows: Vec<f64> = (0..12).map(|n| f64::from(n % 5) - 0.9).collect();
    let single = alone(&rows);
    let twice: Vec<_> = rows.iter().map(|one| [Some(*one), Some(2.0 * one)]).collect();
    // The same twice is no second chance.
    near(sign_flip(&twice)[0], single, 1e-12);
    let mut chance = Seeded::new(3);
    let other: Vec<_> = rows.iter().map(|one| [Some(*one), Some(chance.normal())]).collect();
    assert!(sign_flip(&other)[0] >= single);
    let missing: Vec<_> = rows.iter().map(|one| [Some(*one), None]).collect();
    assert_eq!(sign_flip(&missing), [single, 1.0]);
}

#[test]
fn holm_corrects_as_in_his_example() {
    // By hand: 4 × 0.005, 3 × 0.01, then 2 × 0.03 and 0.04, which may not be less than what came before.
    let corrected = holm(&[0.01, 0.04, 0.03, 0.005].map(|one| (one, 1.0)));
    for (found, expected) in corrected.into_iter().zip([0.03, 0.06, 0.06, 0.02]) {
        near(found, expected, 1e-12);
    }
    assert_eq!(holm(&[(0.9, 1.0), (0.8, 1.0)]), [1.0, 1.0]);
    assert!(holm(&[]).is_empty());
}

#[test]
fn what_weighs_more_is_corrected_less() {
    // 0.02 of a half is as much as 0.01 of a quarter: 0.04, then 0.02 × 0.75 / 0.5, and what is left alone.
    let corrected = holm(&[(0.02, 0.5), (0.008, 0.25), (0.5, 0.25)]);
    for (found, expected) in corrected.into_iter().zip([0.032, 0.032, 0.5]) {
        near(found, expected, 1e-12);
    }
}

#[test]
fn exact_limits_are_as_published() {
    // None of 12 allows 26.5 % (one-sided 22.1 %); of 10 of 20 from the tables of Clopper and Pearson.
    for ((count, of), (low, high)) in [
        ((0, 12), (0.0, 0.2646)),
        ((10, 20), (0.2720, 0.7280)),
        ((1, 10), (0.0025, 0.4450)),
        ((25, 25), (0.8628, 1.0)),
        ((0, 0), (0.0, 1.0)),
    ] {
        let found = clopper_pearson(count, of);
        near(found.0, low, 1e-4);
        near(found.1, high, 1e-4);
    }
}

#[test]
fn the_smallest_difference_follows_from_the_spread() {
    let differences: Vec<f64> = (0..100).map(|n| if n % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let Some(Detectable::Difference(least)) = detectable(&differences, 0.05) else { panic!("no difference") };
    // (1.960 + 0.842) × 1.005 / 10
    near(least, 0.2816, 1e-3);
    assert_eq!(detectable(&[0.0; 9], 0.05), Some(Detectable::Scenes(6)));
    assert_eq!(detectable(&[1.0], 0.05), None);
}

/// Thirty scenes each of two strata; `held` gives what is held of each.
fn figures(held: impl Fn(&str, u64) -> f64) -> BTreeMap<Key, Figures> {
    let strata =
        ["alone", "hidden"].into_iter().flat_map(|stratum| (1..=30).map(move |seed| (stratum, seed)));
    let scene = |(stratum, seed): (&str, u64)| {
        let endpoints = [Some(held(stratum, seed)), None, None, Some(0.0)];
        (("open-loop".to_owned(), stratum.to_owned(), seed, 1), Figures { endpoints, lost: 0.0 })
    };
    strata.map(scene).collect()
}

#[test]
fn what_is_worse_in_one_stratum_is_told_there_alone() {
    let noise = |seed: u64| (seed * 7 % 13) as f64;
    let before = figures(|_, seed| 80.0 + noise(seed));
    let after = figures(|stratum, seed| 80.0 + noise(seed + 3) - if stratum == "hidden" { 9.0 } else { 0.0 });
    let comparison = Comparison::of(&before, &after);
    let verdicts: Vec<_> = comparison.strata.iter().map(|one| (one.name.1.as_str(), one.verdict)).collect();
    assert_eq!(
        verdicts,
        [("all strata", Verdict::Worse), ("alone", Verdict::NotToldApart), ("hidden", Verdict::Worse)]
    );
    let text = comparison.to_string();
    assert!(
        text.contains("Worse: at least one stratum is.") && text.contains("0 (0–12 %) → 0 (0–12 %)"),
        "{text}"
    );
    let back = Comparison::of(&after, &before);
    assert_eq!(back.strata[2].verdict, Verdict::Better);
    assert!(back.to_string().contains("Better: at least one stratum is, and none is worse."));
}

#[test]
fn what_is_a_little_worse_everywhere_is_told_of_all_strata_together() {
    // In two scenes of three.
    let worse = |seed: u64| if seed.is_multiple_of(3) { -0.5 } else { 0.5 };
    let (before, after) = (figures(|_, seed| seed as f64), figures(|_, seed| seed as f64 - worse(seed)));
    let comparison = Comparison::of(&before, &after);
    let verdicts: Vec<_> = comparison.strata.iter().map(|one| one.verdict).collect();
    assert_eq!(verdicts, [Verdict::Worse, Verdict::NotToldApart, Verdict::NotToldApart], "{comparison}");
}

#[test]
fn what_is_the_same_is_not_told_apart() {
    let one = figures(|_, seed| seed as f64);
    let comparison = Comparison::of(&one, &one);
    assert!(!comparison.tells());
    assert!(comparison.to_string().contains("≥ 9 scenes"), "{comparison}");
}

#[test]
fn reports_are_read_and_recordings_of_a_scene_averaged() {
    let heading = crate::strata::table::heading();
    let line = |replicate: &str, held: &str, error: &str| {
        format!("open-loop,ptztrack,alone,3,2,{replicate},{held},0.1,,1,0,,250,10,mjpeg,t,s,g,{error}\n")
    };
    let path = Path::new("scenes.csv");
    let text = heading.clone() + &line("1", "0.8", "") + &line("2", "0.6", "") + &line("3", "0", "broke off");
    let report = Report::parse(&text, path).unwrap();
    let averaged = report.averaged();
    let key = ("open-loop".to_owned(), "alone".to_owned(), 3, 2);
    let endpoints = averaged[&key].endpoints;
    near(endpoints[0].unwrap(), 70.0, 1e-9);
    assert_eq!((endpoints[2], endpoints[3]), (None, Some(360.0)));
    let two = heading + &line("1", "0.8", "") + &line("1", "0.8", "").replace("ptztrack", "thesis");
    assert!(matches!(Report::parse(&two, path), Err(CompareError::Trackers { count: 2, .. })));
    assert!(matches!(Report::parse("a,b\n", path), Err(CompareError::Column { column: "suite", .. })));
}

#[test]
fn a_build_is_rarely_told_from_itself() {
    let mut chance = Seeded::new(17);
    let mut recordings = || (0..2).map(|_| 70.0 + 10.0 * chance.normal()).collect::<Vec<_>>();
    let scenes = figures(|_, _| 0.0).into_keys().map(|key| {
        let figures = |held: f64| Figures { endpoints: [Some(held), None, None, None], lost: 0.0 };
        (key, recordings().into_iter().map(figures).collect())
    });
    let report = Report { generator: "g".into(), scenes: scenes.collect() };
    let count = told(&report, 60);
    assert!(count <= 8, "{count} of 60");
}

proptest! {
    #[test]
    fn a_probability_is_one_and_signs_do_not_matter(values in prop::collection::vec(-5.0f64..5.0, 0..20)) {
        let probability = alone(&values);
        prop_assert!((0.0..=1.0).contains(&probability) && probability > 0.0);
        let mirrored: Vec<f64> = values.iter().map(|value| -value).collect();
        prop_assert_eq!(probability, alone(&mirrored));
    }

    #[test]
    fn corrected_probabilities_are_in_the_order_of_what_they_were(values in prop::collection::vec(0.0f64..1.0, 1..12)) {
        let corrected = holm(&values.iter().map(|one| (*one, 1.0)).collect::<Vec<_>>());
        for (one, other) in (0..values.len()).flat_map(|one| (0..values.len()).map(move |other| (one, other))) {
            prop_assert!(corrected[one] >= values[one]);
            prop_assert!(values[one] > values[other] || corrected[one] <= corrected[other]);
        }
    }

    #[test]
    fn limits_hold_the_share_between_them(of in 1usize..200, part in 0.0f64..=1.0) {
        let count = (of as f64 * part) as usize;
        let (low, high) = clopper_pearson(count, of);
        let share = count as f64 / of as f64;
        prop_assert!(low <= share && share <= high && (0.0..=1.0).contains(&low) && high <= 1.0);
    }
}
