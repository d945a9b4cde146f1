// SPDX-License-Identifier: MPL-2.0

//! Reading and writing `GstStructure` fields with errors that name the field.

use glib::value::FromValue;
use gst::prelude::*;

use crate::named::Named;
use crate::{ContractError, Point, Rect, Vector};

/// Reads fields of one structure.
pub(crate) struct Reader<'a>(&'a gst::StructureRef);

impl<'a> Reader<'a> {
    pub fn new(structure: &'a gst::StructureRef, expected: &'static str) -> Result<Self, ContractError> {
        if structure.name() == expected {
            Ok(Self(structure))
        } else {
            Err(ContractError::WrongName { expected, found: structure.name().to_string() })
        }
    }

    fn field_error(&self, field: &str, reason: impl ToString) -> ContractError {
        ContractError::Field {
            structure: self.0.name().to_string(),
            field: field.to_owned(),
            reason: reason.to_string(),
        }
    }

    pub fn value_error(&self, field: &str, value: impl ToString) -> ContractError {
        ContractError::Value {
            structure: self.0.name().to_string(),
            field: field.to_owned(),
            value: value.to_string(),
        }
    }

    /// What lies in the structure is lent, where `T` is a reference: a copy of a list copies each of its values.
    pub fn get<T: FromValue<'a>>(&self, field: &str) -> Result<T, ContractError> {
        let value = self.0.value(field).map_err(|err| self.field_error(field, err))?;
        value.get::<T>().map_err(|_| self.field_error(field, format!("found a {}", value.type_())))
    }

    /// `None` where the field is absent: optional fields are simply left out.
    pub fn get_optional<T: FromValue<'a>>(&self, field: &str) -> Result<Option<T>, ContractError> {
        if self.0.has_field(field) { self.get(field).map(Some) } else { Ok(None) }
    }

    /// A finite number: NaN and infinities poison every computation downstream.
    pub fn number(&self, field: &str) -> Result<f64, ContractError> {
        let number = self.get::<f64>(field)?;
        if number.is_finite() { Ok(number) } else { Err(self.value_error(field, number)) }
    }

    pub fn number_optional(&self, field: &str) -> Result<Option<f64>, ContractError> {
        if self.0.has_field(field) { self.number(field).map(Some) } else { Ok(None) }
    }

    pub fn point(&self, field: &str) -> Result<Point, ContractError> {
        let [x, y] = self.numbers(field)?;
        Ok(Point { x, y })
    }

    pub fn vector(&self, field: &str) -> Result<Vector, ContractError> {
        let [x, y] = self.numbers(field)?;
        Ok(Vector { x, y })
    }

    pub fn vector_optional(&self, field: &str) -> Result<Option<Vector>, ContractError> {
        if self.0.has_field(field) { self.vector(field).map(Some) } else { Ok(None) }
    }

    pub fn rect(&self, field: &str) -> Result<Rect, ContractError> {
        let [x, y, width, height] = self.numbers(field)?;
        Ok(Rect { x, y, width, height })
    }

    pub fn rect_optional(&self, field: &str) -> Result<Option<Rect>, ContractError> {
        if self.0.has_field(field) { self.rect(field).map(Some) } else { Ok(None) }
    }

    /// Exactly `N` finite numbers.
    pub fn numbers<const N: usize>(&self, field: &str) -> Result<[f64; N], ContractError> {
        let values = self.list(field)?;
        if values.len() != N {
            return Err(self.value_error(field, format!("{} numbers", values.len())));
        }
        self.tuple(field, values)
    }

    /// The same, `None` where the field is absent.
    pub fn numbers_optional<const N: usize>(&self, field: &str) -> Result<Option<[f64; N]>, ContractError> {
        if self.0.has_field(field) { self.numbers(field).map(Some) } else { Ok(None) }
    }

    /// A flat list of finite numbers, `N` to an item.
    pub fn tuples<const N: usize>(&self, field: &str) -> Result<Vec<[f64; N]>, ContractError> {
        let mut tuples = Vec::with_capacity(self.list(field)?.len() / N);
        self.each_tuple(field, |tuple| tuples.push(tuple))?;
        Ok(tuples)
    }

    /// The same, one item after the other.
    pub fn each_tuple<const N: usize>(
        &self,
        field: &str,
        mut take: impl FnMut([f64; N]),
    ) -> Result<(), ContractError> {
        let values = self.list(field)?;
        if !values.len().is_multiple_of(N) {
            return Err(self.value_error(field, format!("{} numbers", values.len())));
        }
        for values in values.chunks_exact(N) {
            take(self.tuple(field, values)?);
        }
        Ok(())
    }

    /// The values of a list.
    pub fn list(&self, field: &str) -> Result<&'a [glib::SendValue], ContractError> {
        self.get::<gst::ArrayRef>(field).map(|list| list.as_slice())
    }

    /// The values of a list of structures.
    pub fn structures(
        &self,
        field: &str,
    ) -> Result<impl ExactSizeIterator<Item = Result<&'a gst::StructureRef, ContractError>>, ContractError>
    {
        let values = self.list(field)?.iter();
        Ok(values.map(move |value| value.get().map_err(|err| self.field_error(field, err))))
    }

    /// As many finite numbers as there are in `values`, which are `N`.
    fn tuple<const N: usize>(
        &self,
        field: &str,
        values: &[glib::SendValue],
    ) -> Result<[f64; N], ContractError> {
        let mut tuple = [0.0; N];
        for (slot, value) in tuple.iter_mut().zip(values) {
            *slot = value
                .get::<f64>()
                .ok()
                .filter(|number| number.is_finite())
                .ok_or_else(|| self.value_error(field, format!("{value:?}")))?;
        }
        Ok(tuple)
    }

    pub fn named<T: Named>(&self, field: &str) -> Result<T, ContractError> {
        let name = self.get::<&str>(field)?;
        T::from_name(name).ok_or_else(|| self.value_error(field, name))
    }

    pub fn named_optional<T: Named>(&self, field: &str) -> Result<Option<T>, ContractError> {
        if self.0.has_field(field) { self.named(field).map(Some) } else { Ok(None) }
    }
}

/// Flattens items into the list form that [`Reader::tuples`] reads.
pub(crate) fn flat<const N: usize>(items: impl IntoIterator<Item = [f64; N]>) -> gst::Array {
    gst::Array::new(items.into_iter().flatten().map(|number| number.to_send_value()))
}

pub(crate) fn point(point: Point) -> gst::Array {
    flat([[point.x, point.y]])
}

pub(crate) fn vector(vector: Vector) -> gst::Array {
    flat([[vector.x, vector.y]])
}

pub(crate) fn rect(rect: Rect) -> gst::Array {
    flat([[rect.x, rect.y, rect.width, rect.height]])
}
