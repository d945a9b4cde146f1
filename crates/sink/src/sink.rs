// SPDX-License-Identifier: MPL-2.0

/// Makes a [`PtzSink`](crate::PtzSink) a GObject class of a name, with its wrapper and what GStreamer says of it. The sink has
/// `Default`.
#[macro_export]
macro_rules! ptz_sink {
    ($sink:ident, $name:literal, $wrapper:ty, $long_name:literal, $description:literal) => {
        #[glib::object_subclass]
        impl ObjectSubclass for $sink {
            const NAME: &'static str = $name;
            type Type = $wrapper;
            type ParentType = gst_base::BaseSink;
        }

        impl ObjectImpl for $sink {
            fn properties() -> &'static [glib::ParamSpec] {
                static PROPERTIES: std::sync::LazyLock<Vec<glib::ParamSpec>> =
                    std::sync::LazyLock::new(|| {
                        let own =
                            <$sink as $crate::PtzSink>::table().iter().map(|property| property.spec.clone());
                        own.chain([$crate::stats_spec()]).collect()
                    });
                &PROPERTIES
            }

            fn set_property(&self, id: usize, value: &glib::Value, _: &glib::ParamSpec) {
                $crate::Plumbing::set(self, id, value);
            }

            fn property(&self, id: usize, _: &glib::ParamSpec) -> glib::Value {
                $crate::Plumbing::get(self, id)
            }

            fn constructed(&self) {
                self.parent_constructed();
                $crate::Plumbing::set_up(self);
            }

            fn dispose(&self) {
                // There is a task if the element was never brought to NULL.
                $crate::Plumbing::finish_task(self);
            }
        }

        impl GstObjectImpl for $sink {}

        impl ElementImpl for $sink {
            fn metadata() -> Option<&'static gst::subclass::ElementMetadata> {
                static METADATA: std::sync::LazyLock<gst::subclass::ElementMetadata> =
                    std::sync::LazyLock::new(|| {
                        gst::subclass::ElementMetadata::new(
                            $long_name,
                            "Sink/Network",
                            $description,
                            "The ptztrack developers",
                        )
                    });
                Some(&METADATA)
            }

            fn pad_templates() -> &'static [gst::PadTemplate] {
                static TEMPLATES: std::sync::LazyLock<Vec<gst::PadTemplate>> =
                    std::sync::LazyLock::new(|| {
                        let caps = gst::Caps::builder("video/x-raw").any_features().build();
                        gst::PadTemplate::new(
                            "sink",
                            gst::PadDirection::Sink,
                            gst::PadPresence::Always,
                            &caps,
                        )
                        .into_iter()
                        .collect()
                    });
                &TEMPLATES
            }

            fn change_state(
                &self,
                transition: gst::StateChange,
            ) -> Result<gst::StateChangeSuccess, gst::StateChangeError> {
                $crate::Plumbing::bring(self, transition)
            }
        }

        impl BaseSinkImpl for $sink {
            fn set_caps(&self, caps: &gst::Caps) -> Result<(), gst::LoggableError> {
                $crate::Plumbing::take_caps(self, caps)
            }

            fn propose_allocation(
                &self,
                query: &mut gst::query::Allocation,
            ) -> Result<(), gst::LoggableError> {
                $crate::Plumbing::propose(self, query)
            }

            fn event(&self, event: gst::Event) -> bool {
                $crate::Plumbing::heed(self, event)
            }

            fn render(&self, buffer: &gst::Buffer) -> Result<gst::FlowSuccess, gst::FlowError> {
                $crate::Plumbing::take(self, buffer)
            }

            fn unlock(&self) -> Result<(), gst::ErrorMessage> {
                $crate::Plumbing::wake(self)
            }

            fn unlock_stop(&self) -> Result<(), gst::ErrorMessage> {
                $crate::Plumbing::let_wait(self)
            }
        }
    };
}

/// An enumeration of GObject's and the servo's of the same values.
#[macro_export]
macro_rules! same_values {
    ($($name:ident = $other:path { $($value:ident),+ })+) => {$(
        impl From<$name> for $other {
            fn from(value: $name) -> Self {
                match value { $($name::$value => Self::$value),+ }
            }
        }

        impl From<$other> for $name {
            fn from(value: $other) -> Self {
                type Other = $other;
                match value { $(Other::$value => Self::$value),+ }
            }
        }
    )+};
}
