// SPDX-License-Identifier: MPL-2.0

use std::ops::ControlFlow;

use gst::buffer::BufferMetaForeachAction::{Keep, Remove};
use gst_video::VideoRegionOfInterestMeta;

/// Removes the regions of interest of that name: those of an element of the same kind further up, whose own
/// meta is replaced, too.
pub(crate) fn remove_regions_of_interest(buffer: &mut gst::BufferRef, name: &str) {
    buffer.foreach_meta_mut(|mut meta| {
        let ours =
            meta.downcast_ref::<VideoRegionOfInterestMeta>().is_some_and(|region| region.roi_type() == name);
        ControlFlow::Continue(if ours { Remove } else { Keep })
    });
}
