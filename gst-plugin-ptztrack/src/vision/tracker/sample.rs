//! A part of a picture at another size.

use opencv::core::{BORDER_REPLICATE, Mat, Point2f, Rect2f, Size};
use opencv::imgproc;

use super::geometry::centre;
use crate::vision::Luma;

/// `area` of the picture at `width` x `height`, the border repeated where it leaves the picture.
pub(super) fn sample(luma: &Luma, area: Rect2f, width: usize, height: usize) -> opencv::Result<Mat> {
    // Taking one pixel of many would see patterns that are not there: take up to 3x3 and average them.
    let fine = (area.width / width as f32).round().clamp(1.0, 3.0);
    let size = Size::new((width as f32 * fine) as i32, (height as f32 * fine) as i32);
    let (across, down) = (area.width / size.width as f32, area.height / size.height as f32);
    let middle = centre(area);
    let corner =
        middle - Point2f::new(area.width - across, area.height - down) / 2.0 - Point2f::new(0.5, 0.5);
    let matrix = Mat::from_slice_2d(&[[across, 0.0, corner.x], [0.0, down, corner.y]])?;
    let flags = imgproc::INTER_LINEAR | imgproc::WARP_INVERSE_MAP;
    let mut grey = Mat::default();
    luma.with_mat(|mat| {
        imgproc::warp_affine(mat, &mut grey, &matrix, size, flags, BORDER_REPLICATE, Default::default())
    })?;
    if fine == 1.0 {
        return Ok(grey);
    }
    let mut coarse = Mat::default();
    let size = Size::new(width as i32, height as i32);
    imgproc::resize(&grey, &mut coarse, size, 0.0, 0.0, imgproc::INTER_AREA)?;
    Ok(coarse)
}
