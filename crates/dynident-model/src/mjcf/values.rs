//! Numbers and keywords in attributes.

use super::classes::Stated;
use super::expanded::Attribute;
use super::fault::{MjcfError, MjcfFault};
use crate::spatial::Vec3;
use crate::urdf::MAX_MAGNITUDE;
use crate::xml::{parse_number, shortened};

impl Stated<'_> {
    pub(super) fn fault(&self, fault: MjcfFault) -> MjcfError {
        self.document.fault(self.place, fault)
    }

    /// All numbers of an attribute. Any magnitude is accepted, because limits such as `1e16` mean "unlimited".
    fn list(&self, attribute: &Attribute) -> Result<Vec<f64>, MjcfError> {
        let number =
            |word: &str| parse_number(word).map_err(|(what, fix)| self.number_fault(attribute, word, what, fix));
        attribute.value.split_ascii_whitespace().map(number).collect()
    }

    fn number_fault(&self, attribute: &Attribute, word: &str, fault: &'static str, fix: &'static str) -> MjcfError {
        let fault = MjcfFault::Number {
            element: self.tag.to_owned(),
            attribute: attribute.name.clone(),
            text: shortened(word),
            fault,
            fix,
        };
        self.document.fault(attribute.place, fault)
    }

    /// Reads between `least` and `most` numbers, each within the magnitude limit.
    pub(super) fn numbers_between(&self, name: &str, least: usize, most: usize) -> Result<Option<Vec<f64>>, MjcfError> {
        let Some(numbers) = self.numbers_of_any_size(name, least, most)? else { return Ok(None) };
        let Some(attribute) = self.get(name) else { return Ok(None) };
        if let Some(number) = numbers.iter().find(|number| number.abs() > MAX_MAGNITUDE) {
            let fix = "a value below 1e9 in m, rad, kg or kg m^2";
            return Err(self.number_fault(attribute, &format!("{number:e}"), "too large for a robot", fix));
        }
        Ok(Some(numbers))
    }

    /// Reads between `least` and `most` numbers of any magnitude.
    pub(super) fn numbers_of_any_size(
        &self,
        name: &str,
        least: usize,
        most: usize,
    ) -> Result<Option<Vec<f64>>, MjcfError> {
        let Some(attribute) = self.get(name) else { return Ok(None) };
        let numbers = self.list(attribute)?;
        if numbers.len() < least || numbers.len() > most {
            return Err(self.count_fault(attribute, if numbers.len() < least { least } else { most }, numbers.len()));
        }
        Ok(Some(numbers))
    }

    fn count_fault(&self, attribute: &Attribute, expected: usize, found: usize) -> MjcfError {
        let (element, name) = (self.tag.to_owned(), attribute.name.clone());
        self.document.fault(attribute.place, MjcfFault::Count { element, attribute: name, expected, found })
    }

    pub(super) fn numbers<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>, MjcfError> {
        let found = self.numbers_between(name, N, N)?;
        Ok(found.map(|found| core::array::from_fn(|k| found[k])))
    }

    pub(super) fn range(&self, name: &str) -> Result<Option<[f64; 2]>, MjcfError> {
        let Some(attribute) = self.get(name) else { return Ok(None) };
        match self.list(attribute)?[..] {
            [low, high] => Ok(Some([low, high])),
            ref other => Err(self.count_fault(attribute, 2, other.len())),
        }
    }

    pub(super) fn number(&self, name: &str) -> Result<Option<f64>, MjcfError> {
        Ok(self.numbers::<1>(name)?.map(|[number]| number))
    }

    /// Reads a nonnegative number.
    pub(super) fn size(&self, name: &'static str) -> Result<Option<f64>, MjcfError> {
        let number = self.number(name)?;
        match (number, self.get(name)) {
            (Some(number), Some(attribute)) if number < 0.0 => {
                let fault = MjcfFault::Negative { element: self.tag.to_owned(), attribute: name };
                Err(self.document.fault(attribute.place, fault))
            }
            _ => Ok(number),
        }
    }

    pub(super) fn vector(&self, name: &str) -> Result<Option<Vec3>, MjcfError> {
        Ok(self.numbers::<3>(name)?.map(Vec3))
    }

    pub(super) fn direction(&self, name: &'static str) -> Result<Option<Vec3>, MjcfError> {
        let Some(vector) = self.vector(name)? else { return Ok(None) };
        let place = self.get(name).map_or(self.place, |attribute| attribute.place);
        self.unit(vector, name).map(Some).map_err(|fault| self.document.fault(place, fault))
    }

    pub(super) fn unit(&self, vector: Vec3, attribute: &'static str) -> Result<Vec3, MjcfFault> {
        let norm = vector.norm();
        // Vectors shorter than 1e-9 are rounding errors of zero.
        if norm < 1e-9 {
            return Err(MjcfFault::NoDirection { element: self.tag.to_owned(), attribute });
        }
        // A division could change vectors whose length is already exactly one.
        Ok(if norm == 1.0 { vector } else { Vec3(vector.0.map(|x| x / norm)) })
    }

    /// Reads `true` or `false`; `None` for `auto` and for a missing attribute.
    pub(super) fn flag(&self, name: &str) -> Result<Option<bool>, MjcfError> {
        match self.word(name, &["true", "false", "auto"], "true, false or auto")? {
            Some("true") => Ok(Some(true)),
            Some("false") => Ok(Some(false)),
            _ => Ok(None),
        }
    }

    pub(super) fn word(
        &self,
        name: &str,
        known: &[&'static str],
        expected: &'static str,
    ) -> Result<Option<&'static str>, MjcfError> {
        let Some(attribute) = self.get(name) else { return Ok(None) };
        let found = known.iter().find(|known| **known == attribute.value.trim());
        found.map(|found| Some(*found)).ok_or_else(|| self.word_fault(attribute, expected))
    }

    pub(super) fn word_fault(&self, attribute: &Attribute, expected: &'static str) -> MjcfError {
        let (element, name) = (self.tag.to_owned(), attribute.name.clone());
        let text = shortened(&attribute.value);
        self.document.fault(attribute.place, MjcfFault::Word { element, attribute: name, text, expected })
    }
}
