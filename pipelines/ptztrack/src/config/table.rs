// SPDX-License-Identifier: MPL-2.0

use std::cell::RefCell;
use std::ops::Range;
use std::time::Duration;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::problem::Problems;
use super::units;

/// A value of the file.
pub type Value<'a> = Spanned<DeValue<'a>>;

/// The file while it is read: every mistake is noted, and reading goes on.
pub struct Source<'a> {
    pub text: &'a str,
    pub problems: RefCell<Problems>,
}

impl Source<'_> {
    pub fn wrong(&self, at: Range<usize>, text: impl Into<String>) {
        self.problems.borrow_mut().add(self.text, at, text);
    }
}

/// One table of the file. Who has asked for all keys that there can be says so by [`Table::no_more`].
pub struct Table<'a> {
    pub source: &'a Source<'a>,
    entries: &'a DeTable<'a>,
    at: Range<usize>,
    asked: Vec<&'static str>,
}

/// What can be read from a value.
pub trait Read: Sized {
    /// In words, after "must be".
    const WHAT: &'static str;

    fn read(value: &DeValue) -> Option<Self>;
}

impl<'a> Table<'a> {
    pub fn new(source: &'a Source<'a>, entries: &'a DeTable<'a>, at: Range<usize>) -> Self {
        Self { source, entries, at, asked: Vec::new() }
    }

    /// A value, where there is one.
    pub fn value(&mut self, key: &'static str) -> Option<&'a Value<'a>> {
        if !self.asked.contains(&key) {
            self.asked.push(key);
        }
        self.entries.get(key)
    }

    /// A value of one kind, where there is one.
    pub fn get<T: Read>(&mut self, key: &'static str) -> Option<T> {
        self.get_with(key, T::WHAT, T::read)
    }

    /// What `read` makes of a value, where there is one; `what` is said to who wrote something else.
    pub fn get_with<T>(
        &mut self,
        key: &'static str,
        what: &str,
        read: impl Fn(&DeValue) -> Option<T>,
    ) -> Option<T> {
        let value = self.value(key)?;
        let found = read(value.get_ref());
        if found.is_none() {
            self.source.wrong(value.span(), format!("`{key}` must be {what}"));
        }
        found
    }

    /// The same of a value that there must be.
    pub fn need<T: Read>(&mut self, key: &'static str) -> Option<T> {
        if self.entries.get(key).is_none() {
            self.source.wrong(self.at.clone(), format!("`{key}` is missing: {}", T::WHAT));
        }
        self.get(key)
    }

    /// A table within, where there is one.
    pub fn table(&mut self, key: &'static str) -> Option<Table<'a>> {
        let value = self.value(key)?;
        self.as_table(key, value)
    }

    /// The tables within, by name.
    pub fn tables(&mut self, key: &'static str) -> Vec<(String, Table<'a>)> {
        let Some(parent) = self.table(key) else { return Vec::new() };
        let named = |(name, value)| Some((String::from(name), self.as_table(name, value)?));
        parent.entries().filter_map(named).collect()
    }

    /// All of it.
    pub fn entries(&self) -> impl Iterator<Item = (&'a str, &'a Value<'a>)> + use<'a> {
        self.entries.iter().map(|(key, value)| (key.get_ref().as_ref(), value))
    }

    pub fn wrong(&self, text: impl Into<String>) {
        self.source.wrong(self.at.clone(), text);
    }

    /// There can be no other keys.
    pub fn no_more(self) {
        for (key, _) in self.entries.iter().filter(|(key, _)| !self.asked.contains(&key.get_ref().as_ref())) {
            let known = self.asked.join(", ");
            self.source
                .wrong(key.span(), format!("`{}` is not known here; there are: {known}", key.get_ref()));
        }
    }

    fn as_table(&self, key: &str, value: &'a Value<'a>) -> Option<Table<'a>> {
        let table = value.get_ref().as_table();
        if table.is_none() {
            self.source.wrong(value.span(), format!("`{key}` must be a table: [{key}]"));
        }
        Some(Table::new(self.source, table?, value.span()))
    }
}

impl Read for String {
    const WHAT: &'static str = "text in quotes";

    fn read(value: &DeValue) -> Option<Self> {
        value.as_str().filter(|text| !text.is_empty()).map(Self::from)
    }
}

impl Read for bool {
    const WHAT: &'static str = "true or false";

    fn read(value: &DeValue) -> Option<Self> {
        value.as_bool()
    }
}

impl Read for Vec<String> {
    const WHAT: &'static str = "a list of texts: [\"...\", \"...\"]";

    fn read(value: &DeValue) -> Option<Self> {
        value.as_array()?.iter().map(|part| String::read(part.get_ref())).collect()
    }
}

impl Read for Duration {
    const WHAT: &'static str = units::DURATION;

    fn read(value: &DeValue) -> Option<Self> {
        units::duration(value.as_str()?)
    }
}

/// Whole, with its sign.
pub fn whole(value: &DeValue) -> Option<i64> {
    let number = value.as_integer()?;
    i64::from_str_radix(number.as_str(), number.radix()).ok()
}
