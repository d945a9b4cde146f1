// SPDX-License-Identifier: MPL-2.0

//! Who is where in a recording, as the MOTChallenge writes it: `frame,id,left,top,width,height[,consider[,...]]` a line.
//!
//! Frames count from 1, boxes in pixels. A `consider` of 0 marks what is not to be counted (arXiv:1603.00831, table 4).
//! In lines of nine fields the last is the part of the person that is not hidden; longer ones end with a place in the
//! world that nobody fills in.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    str::FromStr,
};

use super::panorama::Person;
use crate::truth::Bounds;

/// Why a ground-truth file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MotError {
    /// No such file, or not one to read.
    #[error("cannot read the ground truth {path}: {source}")]
    Unreadable {
        /// As given.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A line is not as it should be.
    #[error("{path}, line {line}: {reason} (expected frame,id,left,top,width,height,... as in MOTChallenge)")]
    Line {
        /// As given.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
}

/// People by the number of the picture, from 0.
pub type People = BTreeMap<u64, Vec<Person>>;

/// Reads a file.
///
/// # Errors
/// Where it cannot be read, or a line of it is not as it should be.
pub fn read(path: &Path) -> Result<People, MotError> {
    let path = path.to_owned();
    match std::fs::read_to_string(&path) {
        Ok(text) => parse(&text).map_err(|(line, reason)| MotError::Line { path, line, reason }),
        Err(source) => Err(MotError::Unreadable { path, source }),
    }
}

/// The error is the number of the line and what is wrong with it.
fn parse(text: &str) -> Result<People, (usize, String)> {
    let mut people = People::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let entry = entry(line).map_err(|reason| (index + 1, reason))?;
        let Some((frame, person)) = entry else {
            continue;
        };
        let there = people.entry(frame - 1).or_default();
        if there.iter().any(|other| other.id == person.id) {
            return Err((index + 1, format!("person {} is in frame {frame} already", person.id)));
        }
        there.push(person);
    }
    Ok(people)
}

/// Frame and person of a line; `None` where it is not to be counted.
fn entry(line: &str) -> Result<Option<(u64, Person)>, String> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let frame = whole(&fields, 0, "frame")?;
    let id =
        u32::try_from(whole(&fields, 1, "id")?).map_err(|_| format!("id is too large: {}", fields[1]))?;
    let (left, top) = (number(&fields, 2, "left")?, number(&fields, 3, "top")?);
    let (width, height) = (number(&fields, 4, "width")?, number(&fields, 5, "height")?);
    if frame == 0 {
        return Err("frames are counted from 1".into());
    }
    if width <= 0.0 || height <= 0.0 {
        return Err(format!("a box of {width} x {height} pixels"));
    }
    if fields.len() > 6 && number(&fields, 6, "consider")? == 0.0 {
        return Ok(None);
    }
    let unhidden = if fields.len() == 9 { number(&fields, 8, "visibility")?.clamp(0.0, 1.0) } else { 1.0 };
    Ok(Some((frame, Person { id, bounds: Bounds { left, top, width, height }, unhidden })))
}

fn whole(fields: &[&str], index: usize, name: &str) -> Result<u64, String> {
    field(fields, index, name, "a whole number")
}

fn number(fields: &[&str], index: usize, name: &str) -> Result<f64, String> {
    let number: f64 = field(fields, index, name, "a number")?;
    if number.is_finite() { Ok(number) } else { Err(format!("{name} is {number}")) }
}

fn field<T: FromStr>(fields: &[&str], index: usize, name: &str, what: &str) -> Result<T, String> {
    let text = fields.get(index).ok_or_else(|| format!("{name} is missing"))?;
    text.parse().map_err(|_| format!("{name} is not {what}: `{text}`"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn people_are_where_the_lines_say() {
        let people =
            parse("2,9,499.20,157.69,31.03,75.17,1,-1,-1,-1\r\n\n1, 4, -5, 6, 7, 8\n2,3,1,2,3,4,1,1,0.25\n")
                .unwrap();
        assert_eq!(people.keys().copied().collect::<Vec<_>>(), [0, 1]);
        let bounds = |left, top, width, height| Bounds { left, top, width, height };
        assert_eq!(people[&0], [Person { id: 4, bounds: bounds(-5.0, 6.0, 7.0, 8.0), unhidden: 1.0 }]);
        assert_eq!(people[&1][0].bounds, bounds(499.2, 157.69, 31.03, 75.17));
        assert_eq!((people[&1][0].unhidden, people[&1][1].unhidden), (1.0, 0.25));
    }

    #[test]
    fn what_is_not_to_be_counted_is_not() {
        assert_eq!(parse("1,4,5,6,7,8,0,9,1\n").unwrap(), People::new());
        assert_eq!(parse("").unwrap(), People::new());
    }

    #[test]
    fn bad_lines_are_named() {
        for (line, reason) in [
            ("1,2,3,4,5", "height is missing"),
            ("", ""),
            ("1;2;3;4;5;6", "frame is not a whole number: `1;2;3;4;5;6`"),
            ("1.5,2,3,4,5,6", "frame is not a whole number: `1.5`"),
            ("0,2,3,4,5,6", "frames are counted from 1"),
            ("1,-1,3,4,5,6", "id is not a whole number: `-1`"),
            ("1,99999999999,3,4,5,6", "id is too large: 99999999999"),
            ("1,2,3,top,5,6", "top is not a number: `top`"),
            ("1,2,nan,4,5,6", "left is NaN"),
            ("1,2,3,4,0,6", "a box of 0 x 6 pixels"),
            ("1,2,3,4,5,6,perhaps", "consider is not a number: `perhaps`"),
            ("7,1,3,4,5,6", "person 1 is in frame 7 already"),
        ] {
            let found = parse(&format!("7,1,1,1,1,1\n{line}\n"));
            let expected = if line.is_empty() { Ok(1) } else { Err((2, reason.to_string())) };
            assert_eq!(found.map(|people| people.len()), expected, "{line}");
        }
    }

    #[test]
    fn errors_name_file_and_line() {
        let missing = read(Path::new("/no/such/gt.txt")).unwrap_err().to_string();
        assert!(missing.starts_with("cannot read the ground truth /no/such/gt.txt: "), "{missing}");
        let line = MotError::Line { path: "gt.txt".into(), line: 3, reason: "id is missing".into() };
        assert!(line.to_string().starts_with("gt.txt, line 3: id is missing (expected frame,id,"));
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(
            frame in 1u64..100_000, id in 0u32..1000, left in -500.0f64..2000.0, top in -500.0f64..2000.0,
            width in 0.1f64..500.0, height in 0.1f64..500.0,
        ) {
            let people = parse(&format!("{frame},{id},{left},{top},{width},{height},1,-1,-1,-1")).unwrap();
            let person = Person { id, bounds: Bounds { left, top, width, height }, unhidden: 1.0 };
            prop_assert_eq!(people.into_iter().collect::<Vec<_>>(), [(frame - 1, vec![person])]);
        }

        #[test]
        fn any_text_is_people_or_an_error(text in "[-0-9.,e\nnai ]{0,60}") {
            let _ = parse(&text);
        }
    }
}
