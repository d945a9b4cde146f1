// SPDX-License-Identifier: MPL-2.0

//! A structure of GStreamer in lines: its name, then `field kind value` each, until `]` where it lies in a field of another. Not in
//! GStreamer's own words, as it is not GStreamer's parser that is tried.

use std::str::Lines;

use gst::prelude::*;

/// The one that begins here; `None` where that is no name for one.
pub fn structure_of(lines: &mut Lines) -> Option<gst::Structure> {
    let name = lines.next().filter(|name| is_name(name))?;
    let mut structure = gst::Structure::new_empty(name);
    while let Some(line) = lines.next() {
        let mut words = line.splitn(3, ' ');
        let (Some(field), Some(kind)) = (words.next().filter(|field| is_name(field)), words.next()) else {
            break;
        };
        let value = match kind {
            "structure" => structure_of(lines).map(|inner| inner.to_send_value()),
            "structures" => {
                let inner = std::iter::from_fn(|| structure_of(lines)).map(|inner| inner.to_send_value());
                Some(gst::Array::new(inner).to_send_value())
            }
            _ => value_of(kind, words.next().unwrap_or_default()),
        };
        if let Some(value) = value {
            structure.set_value(field, value);
        }
    }
    Some(structure)
}

/// As GStreamer has them.
fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || "/-_.:+".contains(c))
}

fn value_of(kind: &str, value: &str) -> Option<glib::SendValue> {
    Some(match kind {
        "bool" => (value == "true").to_send_value(),
        "i32" => value.parse::<i32>().ok()?.to_send_value(),
        "u32" => value.parse::<u32>().ok()?.to_send_value(),
        "u64" => value.parse::<u64>().ok()?.to_send_value(),
        "f64" => value.parse::<f64>().ok()?.to_send_value(),
        "bytes" => glib::Bytes::from(value.as_bytes()).to_send_value(),
        "text" => value.replace('\0', "").to_send_value(),
        "array" => {
            let numbers = value.split(' ').filter_map(|number| number.parse::<f64>().ok());
            gst::Array::new(numbers.map(|number| number.to_send_value())).to_send_value()
        }
        _ => return None,
    })
}
