// SPDX-License-Identifier: MPL-2.0

/// Tells which buffers are not looked at: those that hold no picture (GAP), and those of which a decoder made up what was lost on the
/// way (CORRUPTED). Where that is all there is, as after one loss until the next key frame, it is looked at again after a while.
#[derive(Debug, Default)]
pub struct Unseen {
    /// Made-up pictures in a row.
    made_up: u32,
}

impl Unseen {
    /// A second or two.
    const MOST: u32 = 31;

    /// Whether this buffer, the next of the stream, is not to be looked at.
    pub fn skips(&mut self, buffer: &gst::BufferRef) -> bool {
        let is_made_up = buffer.flags().contains(gst::BufferFlags::CORRUPTED);
        self.made_up = if is_made_up { self.made_up.saturating_add(1) } else { 0 };
        buffer.flags().contains(gst::BufferFlags::GAP) || (1..=Self::MOST).contains(&self.made_up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn made_up_pictures_are_looked_at_where_there_are_no_others() {
        gst::init().unwrap();
        let mut unseen = Unseen::default();
        let mut seen = |flags: gst::BufferFlags| {
            let mut buffer = gst::Buffer::new();
            buffer.get_mut().unwrap().set_flags(flags);
            !unseen.skips(&buffer)
        };
        assert!(seen(gst::BufferFlags::empty()) && !seen(gst::BufferFlags::GAP));
        let made_up = gst::BufferFlags::CORRUPTED;
        assert!((0..Unseen::MOST).all(|_| !seen(made_up)) && seen(made_up) && seen(made_up));
        assert!(seen(gst::BufferFlags::empty()) && !seen(made_up));
        assert!(!seen(gst::BufferFlags::GAP));
    }
}
