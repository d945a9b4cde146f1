// SPDX-License-Identifier: MPL-2.0

use super::super::synthetic::{Picture, Scene};
use super::*;
use proptest::prelude::*;

const PERSON: Rect2f = Rect2f { x: 120.0, y: 70.0, width: 40.0, height: 90.0 };

fn person_at(x: f32, y: f32) -> Picture {
    let mut picture = Scene::new(320, 240).background((0.0, 0.0));
    picture.paint(Rect2f { x, y, ..PERSON }, 7);
    picture
}

/// The figure fills the box.
fn figure(grid: Grid) -> Vec<f32> {
    let inside = |place: usize, count: usize, context: f32| {
        (((place as f32 + 0.5) / count as f32 - 0.5) * context).abs() < 0.5
    };
    (0..grid.columns * grid.rows)
        .map(|index| {
            let (x, y) = (index % grid.columns, index / grid.columns);
            if inside(x, grid.columns, CONTEXT.0) && inside(y, grid.rows, CONTEXT.1) { 1.0 } else { 0.0 }
        })
        .collect()
}

fn trained(luma: &Luma) -> CorrelationFilter {
    let mut filter = CorrelationFilter::new(PERSON).expect("filter");
    learn(&mut filter, luma, PERSON, 1.0);
    filter
}

fn learn(filter: &mut CorrelationFilter, luma: &Luma, bounds: Rect2f, rate: f32) {
    let figure = figure(filter.grid());
    filter.describe(luma, bounds).expect("described");
    filter.learn(&figure, rate).expect("learn");
}

fn respond(filter: &mut CorrelationFilter, luma: &Luma, bounds: Rect2f) -> Response {
    let mut response = Response::default();
    filter.describe(luma, bounds).expect("described");
    filter.respond(&mut response).expect("respond");
    response
}

/// Cells from the middle, and value, of the best answer within reach.
fn peak(response: &Response) -> ((i32, i32), f32) {
    let places = (-7..=7).flat_map(|x| (-7..=7).map(move |y| (x, y)));
    places.map(|place| (place, response.at(place).sum())).max_by(|a, b| a.1.total_cmp(&b.1)).expect("some")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn finds_the_person_nearby(dx in -16.0_f32..16.0, dy in -16.0_f32..16.0) {
        let mut filter = trained(&person_at(PERSON.x, PERSON.y).luma());
        let moved = person_at(PERSON.x + dx, PERSON.y + dy);
        let ((x, y), value) = peak(&respond(&mut filter, &moved.luma(), PERSON));
        let grid = filter.grid();
        let cell = (PERSON.width * CONTEXT.0 / grid.columns as f32, PERSON.height * CONTEXT.1 / grid.rows as f32);
        prop_assert!((x as f32 * cell.0 - dx).abs() < cell.0 && (y as f32 * cell.1 - dy).abs() < cell.1, "{x} {y}");
        prop_assert!(value > 0.2, "{value}");
    }
}

#[test]
fn knows_the_person_from_another() {
    let mut filter = trained(&person_at(PERSON.x, PERSON.y).luma());
    let same = peak(&respond(&mut filter, &person_at(PERSON.x, PERSON.y).luma(), PERSON)).1;
    let mut other = Scene::new(320, 240).background((33.0, 57.0));
    other.paint(PERSON, 1234);
    let other = peak(&respond(&mut filter, &other.luma(), PERSON)).1;
    assert!(same > 0.6 && other < 0.5 * same, "{same} {other}");
}

#[test]
fn the_wall_behind_is_not_learned() {
    // Trained on the person; then the same wall with nobody before it.
    let mut filter = trained(&person_at(PERSON.x, PERSON.y).luma());
    let same = peak(&respond(&mut filter, &person_at(PERSON.x, PERSON.y).luma(), PERSON)).1;
    let wall = Scene::new(320, 240).background((0.0, 0.0));
    let alone = peak(&respond(&mut filter, &wall.luma(), PERSON)).1;
    assert!(alone < 0.4 * same, "{same} {alone}");
}

#[test]
fn learning_takes_over() {
    let mut filter = trained(&person_at(PERSON.x, PERSON.y).luma());
    let mut other = Scene::new(320, 240).background((33.0, 57.0));
    other.paint(PERSON, 1234);
    (0..10).for_each(|_| learn(&mut filter, &other.luma(), PERSON, 0.5));
    assert!(peak(&respond(&mut filter, &other.luma(), PERSON)).1 > 0.5);
}

#[test]
fn any_shape_and_place_is_survived() {
    let picture = Scene::new(16, 16).background((0.0, 0.0));
    for bounds in [
        Rect2f::new(0.0, 0.0, 16.0, 16.0),
        Rect2f::new(-50.0, 3.0, 2.0, 400.0),
        Rect2f::new(5.0, 5.0, 1.0, 1.0),
        Rect2f::new(0.0, 0.0, 900.0, 3.0),
    ] {
        let mut filter = CorrelationFilter::new(bounds).expect("filter");
        learn(&mut filter, &picture.luma(), bounds, 1.0);
        assert!(respond(&mut filter, &picture.luma(), bounds).at((0, 0)).sum().is_finite());
    }
}
