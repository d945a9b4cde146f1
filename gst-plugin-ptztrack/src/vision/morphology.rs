use opencv::core::{self, Mat, Rect, Scalar, Size};
use opencv::imgproc;
use opencv::prelude::*;

/// Opening with a square of that many pixels a side, then closing with a rectangle of that width and height
/// (thesis 3.3.1) of the binary `mask`; 0 and 1 leave it out. An even side counts as the next odd one: only those have a middle, without which
/// the picture would move.
pub fn clean(mask: &mut Mat, open_size: usize, close_size: (usize, usize)) -> opencv::Result<()> {
    // An element as large as the picture does all that a larger one could, which would only cost memory.
    let largest = mask.rows().max(mask.cols()) as usize;
    let (open_size, close_size) =
        (open_size.min(largest), (close_size.0.min(largest), close_size.1.min(largest)));
    if open_size > 1 {
        let mut opened = Mat::default();
        imgproc::morphology_ex_def(mask, &mut opened, imgproc::MORPH_OPEN, &element(open_size, open_size)?)?;
        *mask = opened;
    }
    if close_size.0 > 1 || close_size.1 > 1 {
        *mask = closed(mask, close_size)?;
    }
    Ok(())
}

fn element(width: usize, height: usize) -> opencv::Result<Mat> {
    let odd = |side: usize| i32::try_from(side).unwrap_or(i32::MAX) | 1;
    imgproc::get_structuring_element_def(imgproc::MORPH_RECT, Size::new(odd(width), odd(height)))
}

/// Closing with room around the picture for what the dilation adds: without it, whatever lies within half
/// an element of the edge would grow to the edge.
fn closed(mask: &Mat, side: (usize, usize)) -> opencv::Result<Mat> {
    let room = side.0.max(side.1) as i32;
    let (mut padded, mut closed) = (Mat::default(), Mat::default());
    let black = Scalar::all(0.0);
    core::copy_make_border(mask, &mut padded, room, room, room, room, core::BORDER_CONSTANT, black)?;
    imgproc::morphology_ex_def(&padded, &mut closed, imgproc::MORPH_CLOSE, &element(side.0, side.1)?)?;
    let inside = closed.roi(Rect::new(room, room, mask.cols(), mask.rows()))?;
    inside.try_clone()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cleaned(rows: &[&str], open_size: usize, close_size: (usize, usize)) -> Vec<String> {
        let bytes: Vec<u8> = rows.concat().bytes().map(|pixel| if pixel == b'#' { 255 } else { 0 }).collect();
        let mat = Mat::from_slice(&bytes).unwrap();
        let mut mask = mat.reshape(1, rows.len() as i32).unwrap().try_clone().unwrap();
        clean(&mut mask, open_size, close_size).unwrap();
        let row = |row: &[u8]| row.iter().map(|pixel| if *pixel == 255 { '#' } else { '.' }).collect();
        mask.data_bytes().unwrap().chunks_exact(rows[0].len()).map(row).collect()
    }

    #[test]
    fn opening_removes_specks_and_keeps_what_the_element_fits_into() {
        let mask = ["#......", "...###.", "...###.", "...###.", ".#....."];
        assert_eq!(cleaned(&mask, 3, (0, 0)), [".......", "...###.", "...###.", "...###.", "......."]);
    }

    #[test]
    fn closing_fills_gaps_narrower_than_the_element() {
        let mask = ["........", ".##.##..", ".##.##..", "........"];
        assert_eq!(cleaned(&mask, 0, (3, 3)), ["........", ".#####..", ".#####..", "........"]);
    }

    #[test]
    fn upright_element_closes_gaps_below_and_not_beside() {
        let mask = [".......", ".#.#...", ".......", ".#.#...", "......."];
        assert_eq!(cleaned(&mask, 0, (1, 3)), [".......", ".#.#...", ".#.#...", ".#.#...", "......."]);
    }

    #[test]
    fn opening_comes_first() {
        // Closed first, the specks would grow together into something that survives opening.
        assert_eq!(cleaned(&["#.#.#", ".....", "#.#.#", ".....", "#.#.#"], 3, (3, 3)), ["....."; 5]);
    }

    #[test]
    fn sizes_nought_and_one_change_nothing() {
        let mask = ["#..", ".#.", "..#"];
        assert_eq!(cleaned(&mask, 0, (1, 1)), mask);
    }

    #[test]
    fn elements_larger_than_the_picture_do_no_harm() {
        assert_eq!(cleaned(&["#.", ".."], 50, (0, 0)), ["..", ".."]);
        assert_eq!(cleaned(&["#.", ".#"], 0, (usize::MAX, usize::MAX)), ["#.", ".#"]);
    }
}
