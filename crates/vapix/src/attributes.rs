// SPDX-License-Identifier: MPL-2.0

//! The answer to `query=attributes`: what a camera's steps mean.

use servo::{SpeedUnit, TableRow};
use session::http::unexpected;
use session::{Attributes, Error};

use crate::steps::{part_of_fastest, travel};
use crate::text::Fields;

/// Reads the answer to `query=attributes`; firmware before 5.50 has none.
///
/// A table is told on one line as `name=value=1 | speed=0.05,value=9 | speed=0.16,...` (Axis, "VAPIX
/// Pan/tilt/zoom API", attributes).
///
/// # Errors
/// [`Error::Unexpected`] where it tells nothing that is understood.
pub fn parse_attributes(body: &str) -> Result<Attributes, Error> {
    let fields = Fields::of(body);
    let attributes = Attributes {
        speeds: table(fields.text("speeds"), part_of_fastest),
        speed_unit: SpeedUnit::Degrees,
        zooms: table(fields.text("zooms").or(fields.text("zoom")), travel),
        max_optical_magnification: fields
            .number("maxOpticalZoomMag")
            .filter(|magnification| *magnification >= 1.0),
    };
    if attributes == Attributes::default() { Err(unexpected(body)) } else { Ok(attributes) }
}

/// The rows that grow in both columns, without misprints (the documented example has one), with the settings that their steps are.
fn table(text: Option<&str>, setting: fn(f64) -> f64) -> Vec<TableRow> {
    let rows = text.map(rows).unwrap_or_default();
    rows.into_iter().map(|row| TableRow { setting: setting(row.step), value: row.value }).collect()
}

/// One row as it is told.
struct Row {
    step: f64,
    value: f64,
}

fn rows(text: &str) -> Vec<Row> {
    let mut rows: Vec<Row> = text.split(',').filter_map(row).collect();
    rows.sort_by(|a, b| a.step.total_cmp(&b.step));
    let mut last: Option<(f64, f64)> = None;
    rows.retain(|row| {
        let grows = last.is_none_or(|(step, value)| row.step > step && row.value >= value);
        if grows {
            last = Some((row.step, row.value));
        }
        grows
    });
    while let Some(misprint) = misprint(&rows) {
        rows.remove(misprint);
    }
    rows
}

/// A row this many times larger or smaller than its neighbours let expect may be a misprint.
const MISPRINT: f64 = 2.0;

/// Which row is a misprint most likely.
///
/// On paper with logarithmic axes such tables are a straight line, or bend one way where they begin at a floor, and the
/// other where they end at a ceiling. A wrong row is a spike instead: the curve bends there and back, so at
/// the rows on either side the other way.
fn misprint(rows: &[Row]) -> Option<usize> {
    let bends: Vec<f64> = rows.windows(3).map(bend).collect();
    let spikes = bends.windows(3).enumerate().filter(|(_, around)| {
        around[1].abs() > MISPRINT.ln() && around[0] * around[1] < 0.0 && around[1] * around[2] < 0.0
    });
    // The first bend is that of the second row, and a spike is in the middle of three bends.
    spikes.max_by(|(_, a), (_, b)| a[1].abs().total_cmp(&b[1].abs())).map(|(first, _)| first + 2)
}

/// By how much the middle of three rows is above the straight line through the others, on logarithmic axes; 0 where
/// there is nothing to compare.
fn bend(rows: &[Row]) -> f64 {
    let [low, row, high] = rows else { return 0.0 };
    if low.step <= 0.0 || low.value <= 0.0 {
        return 0.0;
    }
    let share = (row.step / low.step).ln() / (high.step / low.step).ln();
    (row.value / low.value).ln() - share * (high.value / low.value).ln()
}

/// `value=1 | speed=0.05`
fn row(text: &str) -> Option<Row> {
    let (step, meaning) = text.split_once('|')?;
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| *number >= 0.0);
    let step = number(step.trim().strip_prefix("value=")?)?;
    let value = number(meaning.split_once('=')?.1)?;
    (step.is_finite() && value.is_finite()).then_some(Row { step, value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use servo::{SpeedCurve, SpeedMap};

    const DOCUMENTED: &str = "Attributes for camera 1\r\n\
        speeds=value=1 | speed=0.05,value=9 | speed=0.16,value=14 | speed=2,value=24 | speed=2.1,\
        value=40 | speed=9,value=58 | speed=28,value=80 | speed=74,value=100 | speed=150\r\n\
        maxOpticalZoomMag=30\r\n";

    #[test]
    fn axis_table_is_the_curve_it_was_printed_from() {
        let table = "speeds=value=1 | speed=0.05,value=9 | speed=0.16,value=14 | speed=2,value=24 | speed=2.1,\
                     value=40 | speed=9,value=58 | speed=28,value=80 | speed=74,value=100 | speed=150";
        let map = SpeedMap::through(&parse_attributes(table).unwrap().speeds).unwrap();
        for step in [9, 11, 14, 18, 24, 32, 40, 50, 58, 70, 80, 90, 100] {
            let (found, true_deg_s) = (map.deg_s(step), SpeedMap::new(150.0, SpeedCurve::Cubic).deg_s(step));
            assert!((found / true_deg_s).ln().abs() < 1.5f64.ln(), "{step}: {found} instead of {true_deg_s}");
        }
    }

    #[test]
    fn the_documented_table_is_read() {
        let attributes = parse_attributes(DOCUMENTED).unwrap();
        let speeds: Vec<(f64, f64)> =
            attributes.speeds.iter().map(|row| ((row.setting * 100.0).round(), row.value)).collect();
        // Without 14, of which it says 2: as fast as 24, and five times what the others let expect.
        let expected =
            [(1.0, 0.05), (9.0, 0.16), (24.0, 2.1), (40.0, 9.0), (58.0, 28.0), (80.0, 74.0), (100.0, 150.0)];
        assert_eq!(speeds, expected);
        assert_eq!(attributes.max_optical_magnification, Some(30.0));
        assert_eq!(parse_attributes(&DOCUMENTED.replace("\r\n", "\n")).unwrap(), attributes);
    }

    #[test]
    fn what_does_not_grow_or_is_no_number_is_left_out() {
        let body = "speeds=value=50 | speed=20,value=10 | speed=5,value=30 | speed=2,value=x | speed=1,\
                    value=20,value=60 | speed=NaN,value=100 | speed=40";
        let steps: Vec<f64> =
            parse_attributes(body).unwrap().speeds.iter().map(|row| (row.setting * 100.0).round()).collect();
        assert_eq!(steps, [10.0, 50.0, 100.0]);
        assert!(parse_attributes("Attributes for camera 1\r\n").is_err());
    }

    proptest! {
        // Most misprints that are drawn are none that can be told from a bend.
        #![proptest_config(ProptestConfig { max_global_rejects: 65_536, ..ProptestConfig::default() })]

        #[test]
        fn any_text_is_read_or_refused(
            body in "(speeds=|zooms=|value=|speed=|mag=| \\| |,|\r\n|[0-9.eE+-]{1,6}|NaN|inf|maxOpticalZoomMag=|x){0,64}"
        ) {
            if let Ok(attributes) = parse_attributes(&body) {
                for table in [&attributes.speeds, &attributes.zooms] {
                    prop_assert!(table.windows(2).all(|pair| pair[0].setting < pair[1].setting && pair[0].value <= pair[1].value));
                    prop_assert!(table.iter().all(|row| row.setting.is_finite() && row.value.is_finite()));
                }
            }
        }

        #[test]
        fn a_table_of_an_even_curve_is_read_back_whole(
            steps in prop::collection::btree_set(1u32..=100, 1..30), power in 0.5..4.0f64,
            floor in 0.01..5.0f64, ceiling in 20.0..500.0f64,
        ) {
            let speed = |step: u32| (500.0 * (f64::from(step) / 100.0).powf(power)).clamp(floor, ceiling);
            // As they are printed, to two digits.
            let rows: Vec<String> =
                steps.iter().map(|step| format!("value={step} | speed={:.1e}", speed(*step))).collect();
            let read = parse_attributes(&format!("speeds={}\r\n", rows.join(","))).unwrap().speeds;
            let read: Vec<u32> = read.iter().map(|row| (row.setting * 100.0).round() as u32).collect();
            prop_assert_eq!(read, steps.into_iter().collect::<Vec<_>>());
        }

        #[test]
        fn a_misprint_within_a_table_is_left_out(
            wrong in 2usize..8, factor in prop_oneof![0.1..0.3f64, 3.5..10.0f64], power in 1.0..4.0f64,
        ) {
            let speed = |row: usize| 400.0 * (0.1 * (row + 1) as f64).powf(power);
            let value = (speed(wrong) * factor).clamp(speed(wrong - 1), speed(wrong + 1));
            prop_assume!((value / speed(wrong)).ln().abs() > 2.0f64.ln());
            let rows: Vec<String> = (0..10)
                .map(|row| format!("value={} | speed={}", 10 * (row + 1), if row == wrong { value } else { speed(row) }))
                .collect();
            let read = parse_attributes(&format!("speeds={}\r\n", rows.join(","))).unwrap().speeds;
            let read: Vec<usize> = read.iter().map(|row| (row.setting * 10.0).round() as usize - 1).collect();
            prop_assert_eq!(read, (0..10).filter(|row| *row != wrong).collect::<Vec<_>>());
        }
    }
}
