// SPDX-License-Identifier: MPL-2.0

//! One page with everything, that needs no other file.

use std::{fs, path::Path};

use super::{
    Content,
    column::{self, Column},
    definitions::DEFINITIONS,
    judged::Section,
    plot::Plot,
    strip,
    table::escape,
    tables, thesis,
};
use crate::record::TrackerName;

const STYLE: &str = include_str!("page.css");

/// The figures by condition.
const BY_CONDITION: [Column; 6] =
    [column::P, column::DP, column::TF, column::SUCCESS, column::MEAN_DGC, column::LOSSES];

/// The page. Plots are read from `plots` as far as they were drawn.
pub fn html(content: &Content, plots: &Path) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let sections: String =
        content.sections.iter().map(|section| self::section(section, content, plots)).collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<title>ptztrack: evaluation</title>\n\
         <style>\n{STYLE}</style>\n<h1>Following a person with a moving camera</h1>\n\
         <p>ptztrack {version}. The thesis' tests (its chapter 5), rerun in closed loop against a virtual camera in a \
         simulated room, and recordings of real people: pictures delayed, encoded and decoded, commands delayed, every \
         tracker with the same servo. The same seed gives the same figures on any x86-64 machine with the same libraries.</p>\n{}{sections}{}",
        left_out(content) + &failures(content),
        definitions(),
    )
}

fn section(section: &Section, content: &Content, plots: &Path) -> String {
    let mut html = format!("<h2>{}</h2>\n", escape(&capitalised(&section.setup.to_string())));
    html += &tables::worst(section).map(|worst| format!("<p>{}</p>\n", escape(&worst))).unwrap_or_default();
    if !section.printed().is_empty() {
        html += "<p>P and DP: more is better; TF, d_gc, d_gp: less is better. See <a href=\"#counted\">what is counted</a>.</p>\n";
        html += &tables::overview(section).html();
        html += &format!("<p>{}</p>\n", escape(thesis::NOTE));
        html += &BY_CONDITION.map(|column| tables::by_condition(section, &column).html()).concat();
    }
    let recordings = tables::recordings(section);
    if !recordings.rows.is_empty() {
        html += &recordings.html();
    }
    html += &losses(section);
    let shown = content.shown(section);
    let over_time = shown.iter().filter_map(|title| image(&Plot::over_time(section, title), plots));
    html += &titled("h3", "Over time", over_time.collect());
    let strips = shown.iter().map(|title| {
        let strips = section.showing(title).map(strip::html).collect();
        titled("h3", &format!("Telling moments, {title}"), strips)
    });
    html += &strips.collect::<String>();
    let per_test = section
        .trackers()
        .map(|tracker| tables::per_test(section, tracker))
        .filter(|table| !table.rows.is_empty());
    let details = per_test.map(|table| {
        format!("<details><summary>{}</summary>\n{}</details>\n", escape(&table.caption), table.html())
    });
    html + &titled("h3", "Test by test", details.collect())
}

/// So many pictures of losses of one tracker; all of them are in `losses.csv`.
const LOSSES_SHOWN: usize = 60;

fn losses(section: &Section) -> String {
    let pictures = section.trackers().map(|name| {
        let lossy = section.of(name).filter(|one| !one.losses.is_empty()).take(LOSSES_SHOWN);
        let strips: String = lossy.map(strip::losses).collect();
        if strips.is_empty() {
            return strips;
        }
        let open = if name == TrackerName::Ptztrack { " open" } else { "" };
        format!("<details{open}><summary>{name}: where losses began</summary>\n<div class=\"strip\">\n{strips}</div></details>\n")
    });
    let pictures: String = pictures.collect();
    titled("h3", "Losses", tables::causes(section).html() + &pictures)
}

fn definitions() -> String {
    let list =
        DEFINITIONS.iter().map(|(what, how)| format!("<dt>{}</dt><dd>{}</dd>\n", escape(what), escape(how)));
    format!(
        "<h2 id=\"counted\">What is counted</h2>\n<dl>\n{}</dl>\n<p>In the pictures: green the true box, hidden parts \
         included; yellow what the tracker says, where it is right; red where it is not; orange and dashed where it holds \
         the target for occluded.</p>\n",
        list.collect::<String>()
    )
}

fn left_out(content: &Content) -> String {
    let list = content.left_out.iter().map(|reason| format!("<li>{}</li>\n", escape(reason)));
    let list: String = list.collect();
    titled(
        "h2",
        "Trackers that were left out",
        if list.is_empty() { list } else { format!("<ul>\n{list}</ul>\n") },
    )
}

fn failures(content: &Content) -> String {
    let line = |(what, why): (String, &str)| format!("<li>{}: {}</li>\n", escape(&what), escape(why));
    let list: String = content.failures().map(line).collect();
    if list.is_empty() {
        list
    } else {
        format!(
            "<h2>Runs that failed</h2>\n<p>Counted up to there, and left out of all means.</p>\n<ul>\n{list}</ul>\n"
        )
    }
}

/// Nothing under a title is no title either.
fn titled(tag: &str, title: &str, html: String) -> String {
    if html.is_empty() { html } else { format!("<{tag}>{}</{tag}>\n{html}", escape(title)) }
}

fn image(plot: &Plot, folder: &Path) -> Option<String> {
    let png = glib::base64_encode(&fs::read(folder.join(&plot.file)).ok()?);
    let caption = escape(&plot.caption);
    Some(format!(
        "<figure class=\"plot\"><img alt=\"{caption}\" src=\"data:image/png;base64,{png}\"><figcaption>{caption}</figcaption></figure>\n"
    ))
}

fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map(|first| first.to_uppercase().chain(chars).collect()).unwrap_or_default()
}
