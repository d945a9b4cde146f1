// SPDX-License-Identifier: MPL-2.0

use opencv::core::{CV_8UC1, Mat};

/// A picture that cannot be looked at.
#[derive(Debug, thiserror::Error)]
pub enum LumaError {
    /// The memory is smaller than the size and stride say.
    #[error("{width}x{height} luma with {stride} bytes a row needs {needed} bytes, there are {found}")]
    TooShort {
        /// Pixels a row.
        width: usize,
        /// Rows.
        height: usize,
        /// Bytes from one row to the next.
        stride: usize,
        /// Bytes that this takes.
        needed: usize,
        /// Bytes that are there.
        found: usize,
    },
}

/// A borrowed 8-bit grey picture with any stride: plane 0 of a video frame as it lies in memory.
#[derive(Debug, Clone, Copy)]
pub struct Luma<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> Luma<'a> {
    /// Looks at `data` as `height` rows of `width` pixels, `stride` bytes (at least `width`) apart.
    pub fn new(data: &'a [u8], width: usize, height: usize, stride: usize) -> Result<Self, LumaError> {
        let needed = height
            .checked_sub(1)
            .map_or(Some(0), |full_rows| full_rows.checked_mul(stride)?.checked_add(width))
            .unwrap_or(usize::MAX);
        if stride < width || data.len() < needed {
            return Err(LumaError::TooShort { width, height, stride, needed, found: data.len() });
        }
        Ok(Self { data, width, height, stride })
    }

    /// Looks at `data` as packed rows of `width` pixels; what is left over is not looked at.
    pub fn packed(data: &'a [u8], width: usize) -> Self {
        let height = data.len().checked_div(width).unwrap_or(0);
        Self { data, width, height, stride: width }
    }

    /// Pixels a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Bytes from one row to the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// The pixels of row `y`, which must be below `height`.
    pub fn row(&self, y: usize) -> &'a [u8] {
        let start = y * self.stride;
        &self.data[start..start + self.width]
    }

    /// All of its memory: the pixels alone where rows are packed.
    pub fn bytes(&self) -> &'a [u8] {
        self.data
    }

    /// The part of it from (`x`, `y`), cut to the picture.
    pub fn crop(&self, x: usize, y: usize, width: usize, height: usize) -> Luma<'a> {
        let (x, y) = (x.min(self.width), y.min(self.height));
        let (width, height) = (width.min(self.width - x), height.min(self.height - y));
        let start = if width == 0 || height == 0 { self.data.len() } else { y * self.stride + x };
        Luma {
            data: &self.data[start..],
            width,
            height: if width == 0 { 0 } else { height },
            stride: self.stride,
        }
    }

    /// Runs `look` on it as an OpenCV matrix (`CV_8UC1`) over the same memory: nothing is copied.
    pub fn with_mat<T>(&self, look: impl FnOnce(&Mat) -> opencv::Result<T>) -> opencv::Result<T> {
        if self.width == 0 || self.height == 0 {
            return look(&Mat::default());
        }
        // SAFETY: `new` checked that rows, columns and stride lie within `data`, which outlives the call;
        // the matrix is only lent immutably, so OpenCV never writes through the pointer.
        let mat = unsafe {
            Mat::new_rows_cols_with_data_unsafe(
                self.height as i32,
                self.width as i32,
                CV_8UC1,
                self.data.as_ptr().cast_mut().cast(),
                self.stride,
            )
        }?;
        look(&mat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::prelude::*;

    #[test]
    fn strided_rows_and_crop() {
        let data: Vec<u8> = (0..12).collect();
        let luma = Luma::new(&data[..11], 3, 3, 4).expect("fits");
        assert_eq!(luma.row(2), [8, 9, 10]);
        let crop = luma.crop(1, 1, 9, 9);
        assert_eq!((crop.width(), crop.height()), (2, 2));
        assert_eq!(crop.row(1), [9, 10]);
        assert_eq!(luma.crop(3, 0, 1, 1).width(), 0);
    }

    #[test]
    fn matrix_sees_the_same_pixels() {
        let data: Vec<u8> = (0..12).collect();
        let luma = Luma::new(&data, 3, 3, 4).expect("fits");
        let value = luma.with_mat(|mat| mat.at_2d::<u8>(1, 2).copied()).expect("in range");
        assert_eq!(value, 6);
    }

    #[test]
    fn short_memory_is_refused() {
        assert!(Luma::new(&[0; 10], 3, 3, 4).is_err());
        assert!(Luma::new(&[0; 12], 5, 2, 4).is_err());
        assert!(Luma::new(&[], 3, usize::MAX, usize::MAX).is_err());
    }
}
