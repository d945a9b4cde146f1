//! What runs are written down as: CSV for machines, Markdown and one page for people, plots and pictures.

pub mod thesis;

#[cfg(test)]
pub(crate) mod made_up;
