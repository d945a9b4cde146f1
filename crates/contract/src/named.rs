// SPDX-License-Identifier: MPL-2.0

//! Enumerations whose values travel as words.

/// An enumeration whose values travel as words.
pub(crate) trait Named: Sized + Copy + 'static {
    const NAMES: &'static [(Self, &'static str)];

    #[cfg_attr(not(feature = "gst"), allow(dead_code, reason = "only structures are read by name"))]
    fn from_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(_, known)| *known == name).map(|(value, _)| *value)
    }
}

/// Declares an enumeration together with the words its values travel as.
macro_rules! named_enum {
    ($(#[$meta:meta])* $name:ident { $($(#[$variant_meta:meta])* $variant:ident = $word:literal),+ $(,)? }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $name { $($(#[$variant_meta])* $variant),+ }

        impl $name {
            /// The word it travels as.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $word),+ }
            }
        }

        impl crate::named::Named for $name {
            const NAMES: &'static [(Self, &'static str)] = &[$((Self::$variant, $word)),+];
        }
    };
}
pub(crate) use named_enum;
