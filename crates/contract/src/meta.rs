// SPDX-License-Identifier: MPL-2.0

//! Typed access to tag-less [`gst::meta::CustomMeta`]s.
//!
//! A meta without tags survives `videoconvert`, `videoscale` and `videocrop` (measured on 1.22).

use std::sync::Mutex;

use crate::ContractError;

/// A struct that travels on buffers as a custom meta named [`BufferMeta::NAME`].
pub trait BufferMeta: Sized {
    /// Name of the meta and of its structure.
    const NAME: &'static str;

    /// Writes the fields into the meta's structure.
    fn write(&self, structure: &mut gst::StructureRef);

    /// Reads the fields back.
    fn read(structure: &gst::StructureRef) -> Result<Self, ContractError>;

    /// Makes the meta known to GStreamer; calling it again does nothing.
    fn register() {
        // Each plugin carries this code and a lock of its own; only who attaches registers, and a meta is attached by
        // one plugin only.
        static REGISTERING: Mutex<()> = Mutex::new(());
        let _guard = REGISTERING.lock();
        if !gst::meta::CustomMeta::is_registered(Self::NAME) {
            gst::meta::CustomMeta::register(Self::NAME, &[]);
        }
    }

    /// Attaches it to `buffer`, in place of one of the same name.
    fn attach(&self, buffer: &mut gst::BufferRef) -> Result<(), glib::BoolError> {
        Self::register();
        Self::detach(buffer);
        let mut meta = gst::meta::CustomMeta::add(buffer, Self::NAME)?;
        self.write(meta.mut_structure());
        Ok(())
    }

    /// Removes it from `buffer`, if it is there.
    fn detach(buffer: &mut gst::BufferRef) {
        while let Ok(meta) = gst::meta::CustomMeta::from_mut_buffer(buffer, Self::NAME) {
            if meta.remove().is_err() {
                return;
            }
        }
    }

    /// The meta on `buffer`: `None` where there is none, an error where it cannot be read.
    fn of(buffer: &gst::BufferRef) -> Option<Result<Self, ContractError>> {
        let meta = gst::meta::CustomMeta::from_buffer(buffer, Self::NAME).ok()?;
        Some(Self::read(meta.structure()))
    }
}
