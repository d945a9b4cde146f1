// SPDX-License-Identifier: MPL-2.0

use gst::prelude::*;
use gst::subclass::prelude::*;
use ptztrack_contract::{RefusedValues, mistaken_unit};

/// Whether a property of an element may be set to so many nanoseconds; if not, a warning on the bus says why.
pub(crate) fn accepts<E>(element: &E, refused: &RefusedValues, property: &str, value: u64) -> bool
where
    E: ElementImpl,
    E::Type: IsA<gst::Element>,
{
    let mistake = mistaken_unit(property, value);
    if let Some(mistake) = &mistake {
        refused.add(&*element.obj(), format!("{mistake}. `{property}` stays as it was"));
    }
    mistake.is_none()
}
