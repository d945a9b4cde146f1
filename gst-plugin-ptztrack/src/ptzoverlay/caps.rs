// SPDX-License-Identifier: MPL-2.0

//! Caps with and without the feature that says "I draw compositions".

use std::sync::LazyLock;

use gst_video::CAPS_FEATURE_META_GST_VIDEO_OVERLAY_COMPOSITION as COMPOSITION;

/// What the pads take and give: every raw format in system memory, with the feature and without.
pub(super) static TEMPLATE: LazyLock<gst::Caps> = LazyLock::new(|| {
    let plain = gst_video::VideoCapsBuilder::new().build();
    both(&plain)
});

/// Whether the first structure has the feature.
pub(super) fn is_composing(caps: &gst::CapsRef) -> bool {
    caps.features(0).is_some_and(|features| features.contains(COMPOSITION))
}

/// The same caps, each structure with the feature.
pub(super) fn composing(caps: &gst::CapsRef) -> gst::Caps {
    map_features(caps, |features| {
        if !features.contains(COMPOSITION) {
            features.add(COMPOSITION);
        }
    })
}

/// Each structure with the feature, and, less preferred, as it is: what may leave for what comes in.
pub(super) fn both(caps: &gst::CapsRef) -> gst::Caps {
    let mut both = composing(caps);
    both.merge(caps.to_owned());
    both
}

/// Each structure without the feature, and, less preferred, as it is: what may come in for what leaves.
pub(super) fn plain_first(caps: &gst::CapsRef) -> gst::Caps {
    let mut plain = map_features(caps, |features| features.remove(COMPOSITION));
    plain.merge(caps.to_owned());
    plain
}

fn map_features(caps: &gst::CapsRef, change: impl Fn(&mut gst::CapsFeaturesRef)) -> gst::Caps {
    let mut mapped = gst::Caps::new_empty();
    for (structure, features) in caps.iter_with_features() {
        let mut features = features.to_owned();
        change(&mut features);
        mapped
            .merge(gst::Caps::builder_full().structure_with_features(structure.to_owned(), features).build());
    }
    mapped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_feature_comes_and_goes() {
        gst::init().expect("GStreamer");
        let plain = gst_video::VideoCapsBuilder::new().width(64).height(48).build();
        let with = composing(&plain);
        assert!(is_composing(&with) && !is_composing(&plain));
        assert_eq!(composing(&with), with);
        assert_eq!(both(&plain).size(), 2);
        assert!(is_composing(&both(&plain)) && !is_composing(&plain_first(&with)));
        assert_eq!(plain_first(&plain), plain);
    }
}
