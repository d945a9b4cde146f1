//! The answer to `query=attributes`: what a camera's steps mean.

use super::Error;
use super::text::{Fields, unexpected};

/// One row of a table of the camera: what a step of it means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepMeaning {
    /// The step, as commands and positions have it.
    pub step: f64,
    /// What it means, in the table's unit.
    pub value: f64,
}

/// Answer to `query=attributes`; firmware before 5.50 has none.
///
/// A table is told on one line as `name=value=1 | speed=0.05,value=9 | speed=0.16,...` (Axis, "VAPIX
/// Pan/tilt/zoom API", attributes).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Attributes {
    /// `speeds`: degrees per second for steps of `continuouspantiltmove`, growing.
    pub speeds: Vec<StepMeaning>,
    /// `zoom...`: magnification for zoom steps, growing.
    pub zooms: Vec<StepMeaning>,
    /// `maxOpticalZoomMag`.
    pub max_optical_magnification: Option<f64>,
}

impl Attributes {
    /// Reads the answer to `query=attributes`.
    ///
    /// # Errors
    /// [`Error::Unexpected`] where it tells nothing that is understood.
    pub fn parse(body: &str) -> Result<Self, Error> {
        let fields = Fields::of(body);
        let attributes = Self {
            speeds: fields.text("speeds").map(table).unwrap_or_default(),
            zooms: fields.text("zooms").or(fields.text("zoom")).map(table).unwrap_or_default(),
            max_optical_magnification: fields
                .number("maxOpticalZoomMag")
                .filter(|magnification| *magnification >= 1.0),
        };
        if attributes == Self::default() { Err(unexpected(body)) } else { Ok(attributes) }
    }
}

/// The rows that grow in both columns; a misprint (real ones exist) is left out.
fn table(text: &str) -> Vec<StepMeaning> {
    let mut rows: Vec<StepMeaning> = text.split(',').filter_map(row).collect();
    rows.sort_by(|a, b| a.step.total_cmp(&b.step));
    let mut last: Option<StepMeaning> = None;
    rows.retain(|row| {
        let grows = last.is_none_or(|last| row.step > last.step && row.value >= last.value);
        if grows {
            last = Some(*row);
        }
        grows
    });
    rows
}

/// `value=1 | speed=0.05`
fn row(text: &str) -> Option<StepMeaning> {
    let (step, meaning) = text.split_once('|')?;
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| *number >= 0.0);
    let step = number(step.trim().strip_prefix("value=")?)?;
    let value = number(meaning.split_once('=')?.1)?;
    (step.is_finite() && value.is_finite()).then_some(StepMeaning { step, value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DOCUMENTED: &str = "Attributes for camera 1\r\n\
        speeds=value=1 | speed=0.05,value=9 | speed=0.16,value=14 | speed=2,value=24 | speed=2.1,\
        value=40 | speed=9,value=58 | speed=28,value=80 | speed=74,value=100 | speed=150\r\n\
        maxOpticalZoomMag=30\r\n";

    #[test]
    fn the_documented_table_is_read() {
        let attributes = Attributes::parse(DOCUMENTED).unwrap();
        assert_eq!(attributes.speeds.len(), 8);
        assert_eq!(attributes.speeds[0], StepMeaning { step: 1.0, value: 0.05 });
        assert_eq!(attributes.speeds[7], StepMeaning { step: 100.0, value: 150.0 });
        assert_eq!(attributes.max_optical_magnification, Some(30.0));
        assert_eq!(Attributes::parse(&DOCUMENTED.replace("\r\n", "\n")).unwrap(), attributes);
    }

    #[test]
    fn what_does_not_grow_or_is_no_number_is_left_out() {
        let body = "speeds=value=50 | speed=20,value=10 | speed=5,value=30 | speed=2,value=x | speed=1,\
                    value=20,value=60 | speed=NaN,value=100 | speed=40";
        let steps: Vec<f64> = Attributes::parse(body).unwrap().speeds.iter().map(|row| row.step).collect();
        assert_eq!(steps, [10.0, 50.0, 100.0]);
        assert!(Attributes::parse("Attributes for camera 1\r\n").is_err());
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(
            body in "(speeds=|zooms=|value=|speed=|mag=| \\| |,|\r\n|[0-9.eE+-]{1,6}|NaN|inf|maxOpticalZoomMag=|x){0,64}"
        ) {
            if let Ok(attributes) = Attributes::parse(&body) {
                for table in [&attributes.speeds, &attributes.zooms] {
                    prop_assert!(table.windows(2).all(|pair| pair[0].step < pair[1].step && pair[0].value <= pair[1].value));
                    prop_assert!(table.iter().all(|row| row.step.is_finite() && row.value.is_finite()));
                }
            }
        }

        #[test]
        fn a_table_is_read_back(speeds in prop::collection::btree_map(0u32..=100, 1u32..1000, 1..20)) {
            let mut value = 0;
            let rows: Vec<(u32, u32)> = speeds.into_iter().map(|(step, more)| { value += more; (step, value) }).collect();
            let text: Vec<String> = rows.iter().map(|(step, value)| format!("value={step} | speed={value}")).collect();
            let read = Attributes::parse(&format!("speeds={}\r\n", text.join(","))).unwrap().speeds;
            let read: Vec<(u32, u32)> = read.iter().map(|row| (row.step as u32, row.value as u32)).collect();
            prop_assert_eq!(read, rows);
        }
    }
}
