// SPDX-License-Identifier: MPL-2.0

use super::*;
use crate::vision::SceneView;

const GRID: Grid = Grid { columns: 36, rows: 60 };
const BOX: Rect2f = Rect2f { x: 100.0, y: 60.0, width: 40.0, height: 100.0 };

/// A person of one grey before a wall of another, and what the background says of it.
struct Scene {
    luma: Vec<u8>,
    foreground: Vec<u8>,
}

impl Scene {
    const SIZE: (usize, usize) = (320, 240);

    fn new(person: Rect2f, grey: u8, seen_to_move: u8) -> Self {
        let pixels = || {
            (0..Self::SIZE.0 * Self::SIZE.1)
                .map(|i| Point2f::new((i % Self::SIZE.0) as f32 + 0.5, (i / Self::SIZE.0) as f32 + 0.5))
        };
        let of =
            |here: u8, else_: u8| pixels().map(|p| if person.contains(p) { here } else { else_ }).collect();
        Self { luma: of(grey, 150), foreground: of(seen_to_move, 0) }
    }

    fn cells(&self, bounds: Rect2f) -> Cells {
        let plane = |data| Luma::new(data, Self::SIZE.0, Self::SIZE.1, Self::SIZE.0).expect("whole");
        let luma = plane(&self.luma);
        let scene = SceneView::of_greys(luma, luma, plane(&self.foreground));
        let seen = Observation { luma, scene: Some(scene) };
        Cells::observe(&seen, bounds, GRID)
    }
}

#[test]
fn what_moves_is_figure_and_the_wall_is_ground() {
    let cells = Scene::new(BOX, 60, 255).cells(BOX);
    let map = FigureMap::new(&cells, &cells.evidence(None), &Shape::upright(GRID));
    assert!(map.at(centre(BOX)) > 0.95);
    assert!(map.at(Point2f::new(BOX.x - 15.0, 110.0)) < 0.1);
    assert_eq!(map.at(Point2f::new(0.0, 0.0)), 0.0, "beyond the map");
}

#[test]
fn the_silhouette_fits_best_where_the_person_is() {
    let moved = BOX + Point2f::new(8.0, 0.0);
    let cells = Scene::new(moved, 60, 255).cells(BOX);
    let evidence = cells.evidence(None);
    let template = Shape::upright(GRID).template();
    let best = (-6..=6)
        .flat_map(|x| (-6..=6).map(move |y| (x, y)))
        .max_by(|a, b| {
            let fit = |moved| template.fit(&evidence, moved).mean();
            fit(*a).total_cmp(&fit(*b))
        })
        .expect("some");
    // A cell is 2.67 pixels wide.
    assert!((best.0 - 3).abs() <= 1 && best.1.abs() <= 1, "{best:?}");
}

#[test]
fn a_known_wall_fits_nobody() {
    let cells = Scene::new(Rect2f::default(), 60, 255).cells(BOX);
    let fit = Shape::upright(GRID).template().fit(&cells.evidence(None), (0, 0));
    assert!(fit.mean().abs() < 0.05, "{fit:?}");
}

#[test]
fn behind_a_table_the_upper_half_still_fits() {
    let upper = Rect2f { height: 50.0, ..BOX };
    let cells = Scene::new(upper, 60, 255).cells(BOX);
    let fit = Shape::upright(GRID).template().fit(&cells.evidence(None), (0, 0));
    assert!(fit.upper > 0.4 && fit.lower < 0.1, "{fit:?}");
}

/// Of somebody of that grey who moves.
fn colours_of(grey: u8) -> ColourModel {
    let cells = Scene::new(BOX, grey, 255).cells(BOX);
    let map = FigureMap::new(&cells, &cells.evidence(None), &Shape::upright(GRID));
    let ([upper, lower], ground) = cells.histograms(&map);
    ColourModel::new([upper.expect("seen"), lower.expect("seen")], ground.expect("seen"))
}

/// How well an upright silhouette of these colours fits the scene.
fn fit(scene: &Scene, colours: &ColourModel, alone: f32) -> f32 {
    let evidence = scene.cells(BOX).evidence(Some(Looks { colours, alone }));
    Shape::upright(GRID).template().fit(&evidence, (0, 0)).mean()
}

#[test]
fn colours_find_who_stands_still_again() {
    // Seen to move first, then nothing moves any more.
    let colours = colours_of(60);
    let still = fit(&Scene::new(BOX, 60, 128), &colours, f32::INFINITY);
    assert!(still > 0.4, "{still}");
    let gone = fit(&Scene::new(Rect2f::default(), 60, 128), &colours, f32::INFINITY);
    assert!(gone.abs() < 0.05, "{gone}");
}

#[test]
fn beside_others_who_moves_in_other_colours_is_not_the_target() {
    let colours = colours_of(60);
    let fit = |grey, alone| fit(&Scene::new(BOX, grey, 255), &colours, alone);
    let (own, other) = (fit(60, 0.5), fit(220, 0.5));
    assert!(own > 0.4 && other < 0.5 * own, "{own} {other}");
    assert!(fit(220, f32::INFINITY) > 0.4, "alone, whoever moves is the target");
}

#[test]
fn the_centre_of_mass_is_that_of_the_figure() {
    let cells = Scene::new(BOX, 60, 255).cells(BOX);
    let map = FigureMap::new(&cells, &cells.evidence(None), &Shape::upright(GRID));
    let mass = map.centre_of_mass(BOX).expect("seen");
    assert!((mass - centre(BOX)).norm() < 2.0, "{mass:?}");
    assert_eq!(map.centre_of_mass(BOX + Point2f::new(900.0, 0.0)), None);
}
