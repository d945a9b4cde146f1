// SPDX-License-Identifier: MPL-2.0

//! Which cameras there are, and what they are spoken to by.

mod ask;
mod probe;

use std::fmt::Write;
use std::time::Duration;

use futures_util::StreamExt;
use futures_util::stream;

pub use ask::{Found, ask};
use ask::{has_vapix, onvif_client};
use probe::{Heard, MOST, probe};

/// So many are asked at once.
const AT_ONCE: usize = 32;

/// One line of the table.
struct Row {
    address: String,
    name: String,
    protocols: &'static str,
    ptz: &'static str,
}

/// Prints the cameras of this network segment.
///
/// # Errors
/// That there is none, and why that may be.
pub async fn discover(wait: Duration) -> Result<(), String> {
    let heard = probe(wait).await?;
    if heard.is_empty() {
        return Err(format!(
            "No camera answered within {wait:?}. Cameras answer where ONVIF is turned on in their settings, and no router lies in \
             between; any other can be asked by its address: ptztrack follow 192.168.0.90"
        ));
    }
    let rows: Vec<Row> = stream::iter(heard.iter().map(describe)).buffered(AT_ONCE).collect().await;
    print!("{}", table(&rows));
    if heard.len() == MOST {
        eprintln!("There may be more: no more than {MOST} are listed.");
    }
    Ok(())
}

/// Asks a camera what anybody may know.
async fn describe(heard: &Heard) -> Row {
    let ptz = match onvif_client(&heard.location(), None) {
        Ok(mut client) => client.has_ptz().await.ok(),
        Err(_) => None,
    };
    let vapix = has_vapix(&heard.origin()).await;
    Row {
        address: heard.address(),
        name: heard.name.clone(),
        protocols: if vapix { "VAPIX, ONVIF" } else { "ONVIF" },
        ptz: match ptz {
            Some(true) => "yes",
            Some(false) => "no",
            None => "not known",
        },
    }
}

fn table(rows: &[Row]) -> String {
    let width = |cell: fn(&Row) -> &str| rows.iter().map(|row| cell(row).chars().count()).max().unwrap_or(0);
    let (address, name) = (width(|row| &row.address).max(7), width(|row| &row.name).max(4));
    let mut text = format!("{:address$}  {:name$}  {:12}  PTZ\n", "ADDRESS", "NAME", "PROTOCOLS");
    for row in rows {
        let _ =
            writeln!(text, "{:address$}  {:name$}  {:12}  {}", row.address, row.name, row.protocols, row.ptz);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_as_wide_as_what_is_in_it() {
        let row = |address: &str, name: &str| Row {
            address: address.to_owned(),
            name: name.to_owned(),
            protocols: "ONVIF",
            ptz: "yes",
        };
        let text = table(&[row("http://10.0.0.1", "a"), row("http://10.0.0.1:8899", "Käfer")]);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[0], "ADDRESS               NAME   PROTOCOLS     PTZ");
        assert_eq!(lines[1], "http://10.0.0.1       a      ONVIF         yes");
        assert_eq!(lines[2], "http://10.0.0.1:8899  Käfer  ONVIF         yes");
    }
}
