// SPDX-License-Identifier: MPL-2.0

use super::*;
use proptest::prelude::*;

const WIDTH: usize = 160;
const HEIGHT: usize = 120;

fn config() -> DetectorConfig {
    DetectorConfig {
        analysis_width: 640,
        alpha: 0.1,
        test: ForegroundTest::Relative { threshold: 0.15 },
        open_size: None,
        close_size: None,
        choice: RegionChoice::LargestPerimeter,
        min_area: 0.001,
        max_area: 0.8,
        zones: Zones::default(),
        exclude_zones: Zones::default(),
        warm_up: 4,
        confirm_pictures: 2,
    }
}

/// A grey picture with fixed noise of ±3 and bright boxes at these places (pixels).
fn picture(boxes: &[(usize, usize, usize, usize)]) -> Vec<u8> {
    let mut noise = 12345u32;
    let mut picture: Vec<u8> = iter::repeat_with(|| {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        97 + (noise >> 24) as u8 % 7
    })
    .take(WIDTH * HEIGHT)
    .collect();
    for (x, y, width, height) in boxes {
        for row in picture.chunks_exact_mut(WIDTH).skip(*y).take(*height) {
            row[*x..x + width].fill(200);
        }
    }
    picture
}

fn look(detector: &mut Detector, picture: &[u8], config: &DetectorConfig) -> Option<Vec<Region>> {
    let luma = Luma::new(picture, WIDTH, HEIGHT, WIDTH).unwrap();
    detector.process(&luma, config).unwrap()
}

/// A detector that has learned the empty picture.
fn learned(config: &DetectorConfig) -> Detector {
    let mut detector = Detector::default();
    for _ in 0..config.warm_up {
        assert_eq!(look(&mut detector, &picture(&[]), config), None);
    }
    assert_eq!(look(&mut detector, &picture(&[]), config), Some(vec![]));
    detector
}

/// What is found when these boxes stay for two pictures.
fn found(config: &DetectorConfig, boxes: &[(usize, usize, usize, usize)]) -> Vec<Region> {
    let mut detector = learned(config);
    look(&mut detector, &picture(boxes), config);
    look(&mut detector, &picture(boxes), config).unwrap()
}

#[test]
fn a_box_is_found_where_it_is() {
    let regions = found(&config(), &[(40, 30, 20, 60)]);
    let [region] = regions.as_slice() else { panic!("{regions:?}") };
    assert_eq!(region.bounds.to_pixels(WIDTH as u32, HEIGHT as u32), (40, 30, 20, 60));
    assert!((region.centroid.x - 50.0 / 160.0).abs() < 0.01);
}

#[test]
fn a_region_must_be_confirmed() {
    let config = config();
    let mut detector = learned(&config);
    assert_eq!(look(&mut detector, &picture(&[(40, 30, 20, 60)]), &config), Some(vec![]));
    assert_eq!(look(&mut detector, &picture(&[(44, 30, 20, 60)]), &config).unwrap().len(), 1);
}

#[test]
fn choice_is_the_longest_perimeter_or_all() {
    let boxes = [(10, 10, 30, 30), (70, 100, 80, 8)];
    let largest = found(&config(), &boxes);
    assert_eq!(largest.len(), 1);
    assert!(largest[0].bounds.width > 0.4);
    assert_eq!(found(&DetectorConfig { choice: RegionChoice::All, ..config() }, &boxes).len(), 2);
}

#[test]
fn neighbours_stay_apart_and_head_body_and_legs_together() {
    let all = DetectorConfig { choice: RegionChoice::All, ..config() };
    let person = |x| [(x, 30, 12, 10), (x, 44, 12, 20), (x, 68, 12, 20)];
    let regions = found(&all, &[person(40), person(58)].concat());
    let mut boxes: Vec<_> =
        regions.iter().map(|region| region.bounds.to_pixels(WIDTH as u32, HEIGHT as u32)).collect();
    boxes.sort();
    assert_eq!(boxes, [(40, 30, 12, 58), (58, 30, 12, 58)]);
}

#[test]
fn areas_outside_the_limits_do_not_count() {
    let boxes = [(10, 10, 8, 8), (70, 20, 80, 80)];
    let all = DetectorConfig { choice: RegionChoice::All, ..config() };
    assert_eq!(found(&all, &boxes).len(), 2);
    let large = found(&DetectorConfig { min_area: 0.01, ..all.clone() }, &boxes);
    assert_eq!(large.len(), 1);
    assert!(large[0].bounds.width > 0.4);
    let small = found(&DetectorConfig { max_area: 0.01, ..all }, &boxes);
    assert_eq!(small.len(), 1);
    assert!(small[0].bounds.width < 0.1);
}

#[test]
fn only_zones_are_looked_at() {
    let boxes = [(10, 30, 20, 60), (100, 30, 20, 60)];
    let all = DetectorConfig { choice: RegionChoice::All, ..config() };
    let left = "0,0 0.5,0 0.5,1 0,1".parse::<Zones>().unwrap();
    let inside = found(&DetectorConfig { zones: left.clone(), ..all.clone() }, &boxes);
    assert_eq!(inside.len(), 1);
    assert!(inside[0].centroid.x < 0.5);
    let outside = found(&DetectorConfig { exclude_zones: left, ..all }, &boxes);
    assert_eq!(outside.len(), 1);
    assert!(outside[0].centroid.x > 0.5);
}

#[test]
fn zones_may_change_between_pictures() {
    let mut config = config();
    let boxes = [(10, 30, 20, 60)];
    let mut detector = learned(&config);
    look(&mut detector, &picture(&boxes), &config);
    assert_eq!(look(&mut detector, &picture(&boxes), &config).unwrap().len(), 1);
    config.exclude_zones = "0,0 0.5,0 0.5,1 0,1".parse().unwrap();
    assert_eq!(look(&mut detector, &picture(&boxes), &config), Some(vec![]));
}

#[test]
fn another_size_is_learned_anew() {
    let config = config();
    let mut detector = learned(&config);
    let data = picture(&[]);
    let narrow = Luma::new(&data, WIDTH - 1, HEIGHT, WIDTH).unwrap();
    assert_eq!(detector.process(&narrow, &config).unwrap(), None);
}

#[test]
fn reduced_picture_finds_the_same_place() {
    let regions = found(&DetectorConfig { analysis_width: 50, ..config() }, &[(40, 32, 40, 60)]);
    let [region] = regions.as_slice() else { panic!("{regions:?}") };
    let centre = region.bounds.centre();
    assert!((centre.x - 60.0 / 160.0).abs() < 0.02 && (centre.y - 62.0 / 120.0).abs() < 0.03, "{centre:?}");
}

#[test]
fn mask_and_regions_are_drawn_in_the_size_of_the_frame() {
    let config = DetectorConfig { analysis_width: 100, ..config() };
    let boxes = [(40, 32, 20, 60), (100, 20, 16, 40)];
    let mut detector = learned(&config);
    look(&mut detector, &picture(&boxes), &config);
    let regions = look(&mut detector, &picture(&boxes), &config).unwrap();
    let mut mask = vec![9; (WIDTH + 3) * HEIGHT];
    detector.draw_mask(&mut mask, WIDTH + 3, 1).unwrap();
    let at = |drawn: &[u8], x: usize, y: usize| drawn[y * (WIDTH + 3) + x];
    assert_eq!((at(&mask, 50, 60), at(&mask, 108, 40), at(&mask, 80, 40)), (255, 255, 0));
    detector.draw_regions(&regions, &mut mask, WIDTH + 3, 1).unwrap();
    assert_eq!((at(&mask, 50, 60), at(&mask, 108, 40), at(&mask, 80, 40)), (255, 0, 0));
    let mut rgba = vec![9; WIDTH * 4 * HEIGHT];
    detector.draw_regions(&regions, &mut rgba[3..], WIDTH * 4, 4).unwrap();
    let pixel = |x: usize, y: usize| &rgba[(y * WIDTH + x) * 4..][..4];
    assert_eq!((pixel(50, 60), pixel(80, 40)), (&[9, 9, 9, 255][..], &[9, 9, 9, 0][..]));
}

#[test]
fn while_it_learns_the_mask_is_black() {
    let config = config();
    let mut detector = learned(&config);
    look(&mut detector, &picture(&[(40, 32, 20, 60)]), &config);
    detector.relearn();
    look(&mut detector, &picture(&[(40, 32, 20, 60)]), &config);
    let mut mask = vec![9; WIDTH * HEIGHT];
    detector.draw_mask(&mut mask, WIDTH, 1).unwrap();
    assert!(mask.iter().all(|pixel| *pixel == 0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn any_size_and_setting_is_looked_at(
        width in 0usize..70, height in 0usize..40, padding in 0usize..3, analysis_width in 0usize..80,
        open_size in 0usize..90, close_size in 0usize..90, seed in any::<u64>(),
    ) {
        let config = DetectorConfig {
            analysis_width, open_size: Some(open_size), close_size: Some(close_size),
            choice: RegionChoice::All, min_area: 0.0, warm_up: 1,
            confirm_pictures: 1, ..config()
        };
        let mut detector = Detector::default();
        let stride = width + padding;
        for step in 0..4u64 {
            let data: Vec<u8> = (0..stride * height)
                .map(|i| (seed.wrapping_mul(i as u64 * 31 + step + 1) >> 56) as u8)
                .collect();
            let luma = Luma::new(&data, width, height, stride).unwrap();
            for region in detector.process(&luma, &config).unwrap().unwrap_or_default() {
                prop_assert!(region.bounds.x >= 0.0 && region.bounds.x + region.bounds.width <= 1.0 + 1e-9);
                prop_assert!(region.bounds.contains(region.centroid));
            }
            let mut mask = vec![0; stride * height];
            if stride > 0 {
                detector.draw_mask(&mut mask, stride, 1).unwrap();
            }
        }
    }
}
