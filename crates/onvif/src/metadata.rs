// SPDX-License-Identifier: MPL-2.0

//! What is seen in a picture, as the scene description of ONVIF has it (Analytics Service Specification, 5.1): one document for
//! each picture, which travels in a stream of metadata beside the video (Streaming Specification, 5.1.2.1.1).

use std::io;
use std::time::SystemTime;

use chrono::{DateTime, SecondsFormat, Utc};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};

const SCHEMA: &str = "http://www.onvif.org/ver10/schema";

/// The class of all: people and vehicles are not told apart. ONVIF has no word of its own for that; without any class a box is
/// skipped by some readers.
const CLASS: &str = "Object";

/// Somebody or something in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Object {
    /// The same in each picture in which they are seen.
    pub id: u64,
    /// Left, top, width and height of the box: parts of the picture, from its left and its top.
    pub bounds: [f64; 4],
    /// How likely it is that there is something: 0 to 1.
    pub likelihood: f64,
}

impl Object {
    /// Left, top, right and bottom in ONVIF's coordinates: -1 to 1, to the right and up.
    fn edges(&self) -> [f64; 4] {
        let [x, y, width, height] = self.bounds;
        [2.0 * x - 1.0, 1.0 - 2.0 * y, 2.0 * (x + width) - 1.0, 1.0 - 2.0 * (y + height)]
    }

    fn write(&self, writer: &mut Xml) -> io::Result<()> {
        let id = self.id.to_string();
        within(writer, "tt:Object", &[("ObjectId", &id)], |writer| {
            within(writer, "tt:Appearance", &[], |writer| {
                within(writer, "tt:Shape", &[], |writer| self.write_shape(writer))?;
                within(writer, "tt:Class", &[], |writer| {
                    let class = writer.create_element("tt:Type");
                    let class = class.with_attribute(("Likelihood", number(self.likelihood).as_str()));
                    class.write_text_content(BytesText::new(CLASS)).map(drop)
                })
            })
        })
    }

    fn write_shape(&self, writer: &mut Xml) -> io::Result<()> {
        let edges = self.edges();
        let [left, top, right, bottom] = edges.map(number);
        let [x, y] = [(edges[0] + edges[2]) / 2.0, (edges[1] + edges[3]) / 2.0].map(number);
        let sides = [("left", &*left), ("top", &top), ("right", &right), ("bottom", &bottom)];
        writer.create_element("tt:BoundingBox").with_attributes(sides).write_empty()?;
        let centre = [("x", &*x), ("y", &y)];
        writer.create_element("tt:CenterOfGravity").with_attributes(centre).write_empty().map(drop)
    }
}

/// The document of one picture, taken at `time`.
///
/// # Errors
/// None that can happen: what it writes to is memory.
pub fn document(time: SystemTime, objects: &[Object]) -> io::Result<Vec<u8>> {
    let time = DateTime::<Utc>::from(time).to_rfc3339_opts(SecondsFormat::Micros, true);
    let mut writer = Writer::new(Vec::new());
    writer.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    within(&mut writer, "tt:MetadataStream", &[("xmlns:tt", SCHEMA)], |writer| {
        within(writer, "tt:VideoAnalytics", &[], |writer| {
            within(writer, "tt:Frame", &[("UtcTime", &time)], |writer| {
                objects.iter().try_for_each(|object| object.write(writer))
            })
        })
    })?;
    Ok(writer.into_inner())
}

type Xml = Writer<Vec<u8>>;

/// An element with others in it.
fn within(
    writer: &mut Xml,
    name: &str,
    attributes: &[(&str, &str)],
    content: impl FnOnce(&mut Xml) -> io::Result<()>,
) -> io::Result<()> {
    let element = writer.create_element(name).with_attributes(attributes.iter().copied());
    element.write_inner_content(content).map(drop)
}

/// Finer than any picture.
fn number(value: f64) -> String {
    format!("{value:.5}")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_box_is_told_in_the_coordinates_of_onvif_at_the_time_of_its_picture() {
        let time = SystemTime::UNIX_EPOCH + Duration::from_micros(1_764_088_275_040_000);
        let somebody = Object { id: 7, bounds: [0.25, 0.5, 0.25, 0.5], likelihood: 0.875 };
        let text = String::from_utf8(document(time, &[somebody]).unwrap()).unwrap();
        let expected = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\
            <tt:MetadataStream xmlns:tt=\"http://www.onvif.org/ver10/schema\"><tt:VideoAnalytics>\
            <tt:Frame UtcTime=\"2025-11-25T16:31:15.040000Z\"><tt:Object ObjectId=\"7\"><tt:Appearance><tt:Shape>\
            <tt:BoundingBox left=\"-0.50000\" top=\"0.00000\" right=\"0.00000\" bottom=\"-1.00000\"/>\
            <tt:CenterOfGravity x=\"-0.25000\" y=\"-0.50000\"/></tt:Shape>\
            <tt:Class><tt:Type Likelihood=\"0.87500\">Object</tt:Type></tt:Class></tt:Appearance></tt:Object>\
            </tt:Frame></tt:VideoAnalytics></tt:MetadataStream>";
        assert_eq!(text, expected);
    }

    #[test]
    fn a_picture_that_shows_nobody_has_a_document_too() {
        let text = String::from_utf8(document(SystemTime::UNIX_EPOCH, &[]).unwrap()).unwrap();
        assert!(text.contains("<tt:Frame UtcTime=\"1970-01-01T00:00:00.000000Z\"></tt:Frame>"), "{text}");
    }
}
