// SPDX-License-Identifier: MPL-2.0

//! What upstream is told of downstream's wishes.

/// Leaves out that cropping may be left to downstream (`GstVideoCropMeta`): pictures are looked at and drawn on whole, so
/// whoever crops, as decoders do, has to do it first.
pub fn refuse_crop(query: &mut gst::query::Allocation) {
    while let Some(index) = query.find_allocation_meta::<gst_video::VideoCropMeta>() {
        query.remove_nth_allocation_meta(index);
    }
}
