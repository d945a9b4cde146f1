// SPDX-License-Identifier: MPL-2.0

use super::bits::Bits;

/// Opening, then closing, each with a rectangle of that width and height
/// (thesis 3.3.1) of the binary `mask`, whose rows are `width` pixels; 0 and 1 leave it out. An even side counts as the next odd
/// one: only those have a middle, without which the picture would move.
pub fn clean(
    mask: &mut [u8],
    width: usize,
    open_size: (usize, usize),
    close_size: (usize, usize),
    bits: &mut Bits,
) {
    // A rectangle as large as the picture does all that a larger one could, which would only cost memory.
    let largest = mask.len().checked_div(width).unwrap_or(0).max(width);
    let odd = |side: usize| side.clamp(1, largest.max(1)) | 1;
    let [open, close] = [open_size, close_size].map(|(width, height)| (odd(width), odd(height)));
    if (open, close) == ((1, 1), (1, 1)) {
        return;
    }
    bits.load(mask, width, (open.0 + close.0, open.1 + close.1));
    bits.erode(open);
    bits.dilate(open);
    bits.close(close);
    bits.store(mask);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cleaned(rows: &[&str], open_size: usize, close_size: (usize, usize)) -> Vec<String> {
        let bytes: Vec<u8> = rows.concat().bytes().map(|pixel| if pixel == b'#' { 255 } else { 0 }).collect();
        let mut mask = bytes;
        clean(&mut mask, rows[0].len(), (open_size, open_size), close_size, &mut Bits::default());
        let row = |row: &[u8]| row.iter().map(|pixel| if *pixel == 255 { '#' } else { '.' }).collect();
        mask.chunks_exact(rows[0].len()).map(row).collect()
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
