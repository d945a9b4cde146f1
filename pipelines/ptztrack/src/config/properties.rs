// SPDX-License-Identifier: MPL-2.0

//! Properties of elements, by their names.

use std::time::Duration;

use gst::prelude::*;
use serde::{Deserialize, Serialize};
use toml::de::DeValue;

use super::table::Table;
use super::units;

/// The elements whose properties can be set.
pub const ELEMENTS: [&str; 5] =
    ["bgavgdetect", "lkfeaturetrack", "ptzoverlay", "vapixptzsink", "onvifptzsink"];

/// What the program sets itself.
const OURS: [&str; 5] = ["name", "parent", "location", "user", "password"];

/// One property of one element, as text that was understood by the element.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Property {
    pub element: String,
    pub name: String,
    pub value: String,
}

/// The properties of an element in its table.
pub fn read(factory: &str, table: &Table) -> Vec<Property> {
    let Ok(element) = gst::ElementFactory::make(factory).build() else {
        table.wrong(format!(
            "GStreamer has no element {factory}: is its plugin installed? gst-inspect-1.0 {factory}"
        ));
        return Vec::new();
    };
    let mut found = Vec::new();
    for (name, value) in table.entries() {
        match check(&element, name, value.get_ref()) {
            Ok(text) => {
                found.push(Property { element: factory.to_owned(), name: name.to_owned(), value: text })
            }
            Err(reason) => table.source.wrong(value.span(), reason),
        }
    }
    if let Some(reason) = crossed(&element) {
        table.wrong(reason);
    }
    found
}

/// Whether the lower end of a range is beyond its upper one: an element looks at them where it starts.
fn crossed(element: &gst::Element) -> Option<String> {
    let number = |name: &str| {
        element.find_property(name).filter(|spec| spec.value_type() == glib::Type::F64)?;
        Some(element.property::<f64>(name))
    };
    element.list_properties().iter().find_map(|spec| {
        let range = spec.name().strip_suffix("-min")?;
        let (min, max) = (number(spec.name())?, number(&format!("{range}-max"))?);
        (min > max)
            .then(|| format!("`{range}-min` is {min} and `{range}-max` {max}: the first is the lower one"))
    })
}

/// One property from text, as `zones` of a camera.
pub fn of(factory: &str, name: &str, text: &str) -> Result<Property, String> {
    let element = gst::ElementFactory::make(factory).build().map_err(|err| err.to_string())?;
    let spec = writable(&element, name)?;
    accepted(&element, &spec, text)?;
    Ok(Property { element: factory.to_owned(), name: name.to_owned(), value: text.to_owned() })
}

impl Property {
    /// Sets it.
    pub fn set(&self, element: &gst::Element) {
        let value = element
            .find_property(&self.name)
            .and_then(|spec| glib::Value::deserialize_with_pspec(&self.value, &spec).ok());
        if let Some(value) = value {
            element.set_property_from_value(&self.name, &value);
        }
    }
}

fn check(element: &gst::Element, name: &str, value: &DeValue) -> Result<String, String> {
    let spec = writable(element, name)?;
    let text = match value {
        DeValue::String(text) if is_duration(&spec) => match units::duration(text) {
            Some(duration) => duration.as_nanos().to_string(),
            None => return Err(format!("`{name}` must be {}", units::DURATION)),
        },
        DeValue::String(text) => text.to_string(),
        DeValue::Integer(number) => number.as_str().to_owned(),
        DeValue::Float(number) => number.as_str().to_owned(),
        DeValue::Boolean(yes) => yes.to_string(),
        _ => return Err(format!("`{name}` must be {}", allowed(&spec))),
    };
    accepted(element, &spec, &text)?;
    Ok(text)
}

fn writable(element: &gst::Element, name: &str) -> Result<glib::ParamSpec, String> {
    let of_use = |spec: &glib::ParamSpec| {
        spec.flags().contains(glib::ParamFlags::WRITABLE) && !OURS.contains(&spec.name())
    };
    element.find_property(name).filter(of_use).ok_or_else(|| {
        let inherited = gst::Element::static_type();
        let known: Vec<&str> = element
            .list_properties()
            .iter()
            .filter(|spec| of_use(spec) && !inherited.is_a(spec.owner_type()))
            .map(|spec| spec.name())
            .collect();
        format!("`{name}` is no property that can be set here; there are: {}", known.join(", "))
    })
}

/// Sets it on an element that does nothing else, and sees whether it took it.
fn accepted(element: &gst::Element, spec: &glib::ParamSpec, text: &str) -> Result<(), String> {
    let name = spec.name();
    let wrong = || format!("`{name}` must be {}", allowed(spec));
    let value = glib::Value::deserialize_with_pspec(text, spec).map_err(|_| wrong())?;
    if !within(spec, &value) {
        return Err(longest(spec).unwrap_or_else(wrong));
    }
    element.set_property_from_value(name, &value);
    let readable = spec.flags().contains(glib::ParamFlags::READABLE);
    let taken = || element.property_value(name).compare(&value) == Some(std::cmp::Ordering::Equal);
    // An element that has wishes beyond a range says them in its description, and keeps what it had.
    let as_text = |value: &glib::Value| value.serialize().ok();
    if readable && !taken() && as_text(&element.property_value(name)) != as_text(&value) {
        let unit = if is_duration(spec) { " nanoseconds (write \"3s\" for seconds)" } else { "" };
        return Err(format!("`{name}` cannot be {text}{unit}: {}", spec.blurb().unwrap_or_default()));
    }
    Ok(())
}

/// Within the range of a number; GObject would bring others there in silence.
fn within(spec: &glib::ParamSpec, value: &glib::Value) -> bool {
    if let Some(spec) = spec.downcast_ref::<glib::ParamSpecDouble>() {
        value.get::<f64>().is_ok_and(|value| (spec.minimum()..=spec.maximum()).contains(&value))
    } else if let Some(spec) = spec.downcast_ref::<glib::ParamSpecUInt>() {
        value.get::<u32>().is_ok_and(|value| (spec.minimum()..=spec.maximum()).contains(&value))
    } else if let Some(spec) = spec.downcast_ref::<glib::ParamSpecInt>() {
        value.get::<i32>().is_ok_and(|value| (spec.minimum()..=spec.maximum()).contains(&value))
    } else if let Some(spec) = spec.downcast_ref::<glib::ParamSpecUInt64>() {
        value.get::<u64>().is_ok_and(|value| (spec.minimum()..=spec.maximum()).contains(&value))
    } else {
        true
    }
}

/// What a property takes, in words.
fn allowed(spec: &glib::ParamSpec) -> String {
    if let Some(spec) = spec.downcast_ref::<glib::ParamSpecDouble>() {
        format!("a number from {} to {}", spec.minimum(), spec.maximum())
    } else if let Some(spec) = spec.downcast_ref::<glib::ParamSpecUInt>() {
        format!("a whole number from {} to {}", spec.minimum(), spec.maximum())
    } else if let Some(spec) = spec.downcast_ref::<glib::ParamSpecInt>() {
        format!("a whole number from {} to {}", spec.minimum(), spec.maximum())
    } else if is_duration(spec) {
        units::DURATION.to_owned()
    } else if let Some(class) = glib::EnumClass::with_type(spec.value_type()) {
        let nicks: Vec<&str> = class.values().iter().map(glib::EnumValue::nick).collect();
        format!("one of {}", nicks.join(", "))
    } else if spec.value_type() == glib::Type::BOOL {
        "true or false".to_owned()
    } else {
        format!("text in quotes: {}", spec.blurb().unwrap_or_default())
    }
}

/// What a duration is at most, in words.
fn longest(spec: &glib::ParamSpec) -> Option<String> {
    let most = Duration::from_nanos(spec.downcast_ref::<glib::ParamSpecUInt64>()?.maximum());
    Some(format!("`{}` must be {}, at most {most:?}", spec.name(), units::DURATION))
}

/// Durations are 64 bits of nanoseconds in every element of ours.
fn is_duration(spec: &glib::ParamSpec) -> bool {
    spec.value_type() == glib::Type::U64
}
