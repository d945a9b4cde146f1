// SPDX-License-Identifier: MPL-2.0

//! Who is where in a recording, as those wrote it down who published it.

use std::path::{Path, PathBuf};

use virtual_camera::{Bounds, MotError, People, Person, read_mot};

/// Why a ground-truth file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TruthError {
    /// No such file, or not one to read.
    #[error("cannot read the ground truth {}: {source}", path.display())]
    Unreadable {
        /// As given.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// In MOTChallenge format, but wrong.
    #[error(transparent)]
    Mot(#[from] MotError),
    /// A box is not as it should be.
    #[error("{}, line {line}: expected left,top,width,height or left,top,right,bottom", path.display())]
    Line {
        /// As given.
        path: PathBuf,
        /// From 1.
        line: usize,
    },
    /// There is nobody to follow.
    #[error("{} tells of nobody", path.display())]
    Nobody {
        /// As given.
        path: PathBuf,
    },
}

/// Reads a file in one of three formats, told apart by what stands in them: MOTChallenge (six fields and more), or one
/// line of four numbers for each picture, either `left,top,width,height` (OTB) or `left,top,right,bottom` with `NaN`
/// where the person is gone (TLD).
///
/// # Errors
/// Where it cannot be read as any of these, or tells of nobody.
pub fn read(path: &Path) -> Result<People, TruthError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| TruthError::Unreadable { path: path.into(), source })?;
    let is_mot = text.lines().next().is_some_and(|line| fields(line).count() >= 6);
    let people = if is_mot {
        read_mot(path)?
    } else {
        boxes(&text).map_err(|line| TruthError::Line { path: path.into(), line })?
    };
    if people.is_empty() { Err(TruthError::Nobody { path: path.into() }) } else { Ok(people) }
}

fn fields(line: &str) -> impl Iterator<Item = &str> {
    line.split([',', '\t', ' ']).map(str::trim).filter(|field| !field.is_empty())
}

/// One person, number 1. The error is the number of the line.
fn boxes(text: &str) -> Result<People, usize> {
    let quadruple = |(index, line): (usize, &str)| {
        let numbers: Option<Vec<f64>> = fields(line).map(|field| field.parse().ok()).collect();
        numbers.and_then(|numbers| <[f64; 4]>::try_from(numbers).ok()).ok_or(index + 1)
    };
    let lines = text.trim_end().lines().enumerate().map(quadruple).collect::<Result<Vec<_>, _>>()?;
    // A corner is never left of or above the other; a size soon is smaller than a place.
    let corners = lines.iter().all(|[left, top, x, y]| {
        let gone = [left, top, x, y].iter().any(|number| number.is_nan());
        gone || (x > left && y > top)
    });
    let bounds = |[left, top, x, y]: [f64; 4]| {
        let (width, height) = if corners { (x - left, y - top) } else { (x, y) };
        let sound =
            [left, top, width, height].iter().all(|number| number.is_finite()) && width > 0.0 && height > 0.0;
        sound.then_some(Bounds { left, top, width, height })
    };
    let person = |bounds| vec![Person { id: 1, bounds, unhidden: 1.0 }];
    let pictures = (0..).zip(lines);
    Ok(pictures.filter_map(|(picture, numbers)| Some((picture, person(bounds(numbers)?)))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(text: &str) -> Bounds {
        boxes(text).unwrap()[&0][0].bounds
    }

    #[test]
    fn sizes_and_corners_are_told_apart() {
        let expected = Bounds { left: 51.0, top: 47.0, width: 25.0, height: 62.0 };
        assert_eq!(first("51\t47\t25\t62\n47\t42\t24\t62\n"), expected);
        assert_eq!(first("51,47,76,109\n"), expected);
        let gone = boxes("51,47,76,109\nNaN,NaN,NaN,NaN\n52,47,77,109\n").unwrap();
        assert_eq!(gone.keys().copied().collect::<Vec<_>>(), [0, 2]);
        assert_eq!(boxes("1,2,3,4\n1,2,3\n"), Err(2));
        assert_eq!(boxes("1,2,3,four\n"), Err(1));
    }

    #[test]
    fn a_file_that_cannot_be_used_says_which_and_why() {
        let missing = read(Path::new("/nowhere/gt.txt")).unwrap_err().to_string();
        assert!(missing.contains("/nowhere/gt.txt"), "{missing}");
        let empty = read(Path::new("/dev/null")).unwrap_err().to_string();
        assert_eq!(empty, "/dev/null tells of nobody");
    }
}
