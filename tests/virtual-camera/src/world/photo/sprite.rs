// SPDX-License-Identifier: MPL-2.0

//! Somebody cut out of film: pictures with an alpha channel, and a list of which way they walk in each.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, OnceLock},
};

use super::{equirectangular::yuv, rgba::Rgba, settings::PhotoError, way::turned};
use crate::sync::lock;

/// Metres walked in a cycle of the gait, two steps.
pub(super) const STRIDE: f64 = 1.31;
/// Columns of the list that are used.
const COLUMNS: [&str; 6] = ["heading", "foot_x", "foot_y", "height_px", "phase", "file"];
/// A phase that is off by so much is as bad as a heading that is off by a degree.
const PHASE: f64 = 0.02;

/// One picture of the list.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Row {
    /// Which way they walk, in degrees: 0 towards the camera, 90 to the right.
    heading_deg: f64,
    /// The point on the ground below the body, and their standing height, in pixels of the picture.
    pub foot: (f64, f64),
    pub height_px: f64,
    /// Of the gait, 0 to 1.
    phase: f64,
    file: PathBuf,
}

/// A picture: itself and each level half as fine as the one before. Y, U, V, and 1 where somebody is.
#[derive(Debug)]
pub(super) struct Sprite {
    levels: Vec<(usize, usize, Vec<[u8; 4]>)>,
}

/// One of its levels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level<'a> {
    width: usize,
    height: usize,
    pixels: &'a [[u8; 4]],
    /// Its pixels in one of the whole picture, across and down.
    finer: f64,
}

/// Everybody's pictures are decoded once, when they are needed.
pub(super) struct Sprites {
    pub rows: Vec<Row>,
    decoded: Mutex<HashMap<(usize, bool), Arc<Sprite>>>,
}

impl Sprites {
    /// Those that `walker.csv` in a folder lists.
    pub fn open(folder: &Path) -> Result<Arc<Self>, PhotoError> {
        static OPEN: OnceLock<Mutex<HashMap<PathBuf, Arc<Sprites>>>> = OnceLock::new();
        let mut open = lock(OPEN.get_or_init(Mutex::default));
        if let Some(known) = open.get(folder) {
            return Ok(known.clone());
        }
        let rows = read(&folder.join("walker.csv"), folder)?;
        let sprites = Arc::new(Self { rows, decoded: Mutex::default() });
        open.insert(folder.into(), sprites.clone());
        Ok(sprites)
    }

    /// Which picture shows them best, and whether it is to be mirrored.
    pub fn choose(&self, heading_deg: f64, walked: f64) -> (usize, bool) {
        let phase = (walked / STRIDE).rem_euclid(1.0);
        let misfit = |row: &Row, mirrored: bool| {
            // In a mirror left and right foot change places.
            let (heading, step) = if mirrored { (-row.heading_deg, 0.5) } else { (row.heading_deg, 0.0) };
            let off = turned(360.0 * (row.phase + step), 360.0 * phase).abs() / 360.0;
            turned(heading, heading_deg).abs() + off / PHASE
        };
        let all = (0..self.rows.len()).flat_map(|index| [(index, false), (index, true)]);
        let best = all.min_by(|&(one, a), &(other, b)| {
            misfit(&self.rows[one], a).total_cmp(&misfit(&self.rows[other], b))
        });
        best.unwrap_or((0, false))
    }

    /// A picture, `other` with the strongest colour of the clothes turned into another.
    pub fn picture(&self, index: usize, other: bool) -> Result<Arc<Sprite>, PhotoError> {
        if let Some(known) = lock(&self.decoded).get(&(index, other)) {
            return Ok(known.clone());
        }
        let decoded = Arc::new(Sprite::decode(&self.rows[index].file, other)?);
        lock(&self.decoded).insert((index, other), decoded.clone());
        Ok(decoded)
    }
}

impl Sprite {
    fn decode(path: &Path, other: bool) -> Result<Self, PhotoError> {
        let picture = Rgba::read(path)?;
        let mut size = (picture.width, picture.height);
        let dyed = if other { dye } else { |colour| colour };
        let mut pixels: Vec<[u8; 4]> = picture
            .pixels
            .iter()
            .map(|&[r, g, b, alpha]| {
                let [y, u, v] = dyed(yuv([r, g, b]));
                if alpha > 127 { [y, u, v, 1] } else { [0; 4] }
            })
            .collect();
        let mut levels = Vec::new();
        while size.0 >= 8 && size.1 >= 8 {
            let half = (size.0 / 2, size.1 / 2);
            let mean = |i: usize| {
                let first = i / half.0 * 2 * size.0 + i % half.0 * 2;
                let four = [first, first + 1, first + size.0, first + size.0 + 1].map(|at| pixels[at]);
                let there: u32 = four.iter().map(|pixel| u32::from(pixel[3])).sum();
                let part = |part: usize| {
                    let sum: u32 = four.iter().map(|pixel| u32::from(pixel[part])).sum();
                    ((sum + there / 2) / there.max(1)) as u8
                };
                if there >= 2 { [part(0), part(1), part(2), 1] } else { [0; 4] }
            };
            let smaller = (0..half.0 * half.1).map(mean).collect();
            levels.push((size.0, size.1, std::mem::replace(&mut pixels, smaller)));
            size = half;
        }
        if levels.is_empty() {
            let reason = "a picture of somebody has 8 pixels a side at least".into();
            return Err(PhotoError::Nonsense { path: path.into(), reason });
        }
        Ok(Self { levels })
    }

    /// The level for samples that are `step` pixels of the picture apart.
    pub fn level(&self, step: f64) -> Level<'_> {
        let level = (step.max(1.0).log2().round() as usize).min(self.levels.len() - 1);
        let (width, height, pixels) = &self.levels[level];
        Level { width: *width, height: *height, pixels, finer: 1.0 / f64::from(1u32 << level) }
    }
}

impl Level<'_> {
    /// What is at a place, in pixels of the whole picture, whose edges are at whole numbers: the nearest pixel.
    #[inline]
    pub fn at(self, x: f64, y: f64) -> [u8; 4] {
        let (x, y) = (x * self.finer, y * self.finer);
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        if inside { self.pixels[y as usize * self.width + x as usize] } else { [0; 4] }
    }
}

/// How blue-green cloth is, in parts of its brightness, from where on it is dyed and where all of it is.
const CYAN: (f64, f64) = (0.07, 0.14);

/// Blue-green becomes dark red; everything else stays.
fn dye([y, u, v]: [u8; 3]) -> [u8; 3] {
    let (light, blue, red) = (f64::from(y) - 16.0, f64::from(u) - 128.0, f64::from(v) - 128.0);
    let cyan = -red / light.max(16.0);
    let strength = ((cyan - CYAN.0) / (CYAN.1 - CYAN.0)).clamp(0.0, 1.0);
    let turn = |value: f64, to: f64| (value + (to - value) * strength).clamp(0.0, 255.0) as u8;
    [
        turn(f64::from(y), 16.0 + 0.75 * light),
        turn(f64::from(u), 128.0 - 0.3 * blue.abs()),
        turn(f64::from(v), 128.0 - 0.8 * red),
    ]
}

fn read(list: &Path, folder: &Path) -> Result<Vec<Row>, PhotoError> {
    let unreadable = |source| PhotoError::Unreadable { path: list.into(), source };
    let text = std::fs::read_to_string(list).map_err(unreadable)?;
    let nonsense = |reason: String| PhotoError::Nonsense { path: list.into(), reason };
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let (_, header) = lines.next().ok_or_else(|| nonsense("it is empty".into()))?;
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    let mut columns = [0; COLUMNS.len()];
    for (column, name) in columns.iter_mut().zip(COLUMNS) {
        let place = names.iter().position(|known| *known == name);
        *column = place.ok_or_else(|| nonsense(format!("its first line names no column {name}")))?;
    }
    let rows: Option<Vec<Row>> = lines.clone().map(|(_, line)| row(line, &columns, folder)).collect();
    match rows {
        Some(rows) if !rows.is_empty() => Ok(rows),
        Some(_) => Err(nonsense("it lists no picture".into())),
        None => {
            let bad = lines.find(|(_, line)| row(line, &columns, folder).is_none());
            Err(nonsense(format!("line {} is none of its kind", bad.map_or(0, |(number, _)| number + 1))))
        }
    }
}

fn row(line: &str, columns: &[usize; COLUMNS.len()], folder: &Path) -> Option<Row> {
    let cells: Vec<&str> = line.split(',').map(str::trim).collect();
    let cell = |index: usize| cells.get(columns[index]).copied();
    let number = |index: usize| cell(index)?.parse::<f64>().ok().filter(|number| number.is_finite());
    Some(Row {
        heading_deg: number(0)?,
        foot: (number(1)?, number(2)?),
        height_px: number(3).filter(|height| *height >= 1.0)?,
        phase: number(4)?,
        file: folder.join(cell(5)?),
    })
}
