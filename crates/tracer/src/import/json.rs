//! Typed reading of JSON objects that knows where it is, so that every error names its place.

use serde_json::{Map, Value};

use super::error::{ContentError, Fault, place_of};

/// One JSON object of the file and what to call it in messages.
#[derive(Clone, Debug)]
pub(super) struct Object<'a> {
    pub(super) map: &'a Map<String, Value>,
    pub(super) place: String,
}

impl<'a> Object<'a> {
    pub(super) fn new(map: &'a Map<String, Value>, place: impl Into<String>) -> Self {
        Self { map, place: place.into() }
    }

    pub(super) fn fault(&self, cause: ContentError) -> Fault {
        Fault::new(self.place.clone(), cause)
    }

    pub(super) fn bad(&self, key: &str, problem: impl Into<String>) -> Fault {
        self.fault(ContentError::Property { key: key.to_owned(), problem: problem.into() })
    }

    pub(super) fn name(&self) -> &'a str {
        self.map.get("name").and_then(Value::as_str).unwrap_or_default()
    }

    /// The object under `key`, if there is one.
    pub(super) fn object(&self, key: &str) -> Result<Option<Object<'a>>, Fault> {
        match self.map.get(key) {
            None => Ok(None),
            Some(Value::Object(map)) => Ok(Some(Object::new(map, self.place.clone()))),
            Some(_) => Err(self.bad(key, "is not an object")),
        }
    }

    /// The object of the extension `name`, if there is one.
    pub(super) fn extension(&self, name: &str) -> Result<Option<Object<'a>>, Fault> {
        self.object("extensions")?.map_or(Ok(None), |extensions| extensions.object(name))
    }

    /// The array under `key`; empty when absent.
    pub(super) fn array(&self, key: &str) -> Result<&'a [Value], Fault> {
        match self.map.get(key) {
            None => Ok(&[]),
            Some(Value::Array(values)) => Ok(values),
            Some(_) => Err(self.bad(key, "is not an array")),
        }
    }

    /// The objects of the array under `key`; each is called `kind index 'name'`, behind this object's place if it has one.
    pub(super) fn objects(&self, key: &str, kind: &str) -> Result<Vec<Object<'a>>, Fault> {
        let objects = self.array(key)?.iter().enumerate().map(|(index, value)| {
            let map =
                value.as_object().ok_or_else(|| self.bad(key, format!("has an entry {index} that is no object")))?;
            let own = place_of(kind, index, map.get("name").and_then(Value::as_str).unwrap_or_default());
            Ok(Object::new(map, if self.place.is_empty() { own } else { format!("{} {own}", self.place) }))
        });
        objects.collect()
    }

    pub(super) fn string(&self, key: &str) -> Result<Option<&'a str>, Fault> {
        self.map.get(key).map(|v| v.as_str().ok_or_else(|| self.bad(key, "is not a string"))).transpose()
    }

    /// The strings of the array under `key`; empty when absent.
    pub(super) fn strings(&self, key: &str) -> Result<Vec<String>, Fault> {
        let text =
            |v: &Value| v.as_str().map(str::to_owned).ok_or_else(|| self.bad(key, "has an entry that is no string"));
        self.array(key)?.iter().map(text).collect()
    }

    pub(super) fn bool_or(&self, key: &str, default: bool) -> Result<bool, Fault> {
        self.map.get(key).map_or(Ok(default), |v| v.as_bool().ok_or_else(|| self.bad(key, "is not true or false")))
    }

    pub(super) fn uint(&self, key: &str) -> Result<Option<u64>, Fault> {
        self.map.get(key).map(|v| as_uint(v).ok_or_else(|| self.bad(key, "is not a whole number >= 0"))).transpose()
    }

    pub(super) fn required_uint(&self, key: &str) -> Result<u64, Fault> {
        self.uint(key)?.ok_or_else(|| self.bad(key, "is missing"))
    }

    pub(super) fn size_or(&self, key: &str, default: usize) -> Result<usize, Fault> {
        self.uint(key)?.map_or(Ok(default), |n| usize::try_from(n).map_err(|_| self.bad(key, "is too large")))
    }

    pub(super) fn number(&self, key: &str) -> Result<Option<f64>, Fault> {
        self.map.get(key).map(|v| v.as_f64().ok_or_else(|| self.bad(key, "is not a number"))).transpose()
    }

    /// `N` numbers under `key`, if there are any.
    pub(super) fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, Fault> {
        if !self.map.contains_key(key) {
            return Ok(None);
        }
        let values: Vec<f64> = self.array(key)?.iter().filter_map(Value::as_f64).collect();
        values.try_into().map(Some).map_err(|_| self.bad(key, format!("is not an array of {N} numbers")))
    }

    /// A reference to one of `count` things.
    pub(super) fn index(&self, key: &str, kind: &'static str, count: usize) -> Result<Option<usize>, Fault> {
        self.uint(key)?.map(|index| self.check_index(key, kind, index, count)).transpose()
    }

    pub(super) fn required_index(&self, key: &str, kind: &'static str, count: usize) -> Result<usize, Fault> {
        self.index(key, kind, count)?.ok_or_else(|| self.bad(key, "is missing"))
    }

    /// The references in the array under `key`; empty when absent.
    pub(super) fn indices(&self, key: &str, kind: &'static str, count: usize) -> Result<Vec<usize>, Fault> {
        let index = |v: &Value| {
            let index = as_uint(v).ok_or_else(|| self.bad(key, "has an entry that is no whole number >= 0"))?;
            self.check_index(key, kind, index, count)
        };
        self.array(key)?.iter().map(index).collect()
    }

    fn check_index(&self, key: &str, kind: &'static str, index: u64, count: usize) -> Result<usize, Fault> {
        usize::try_from(index)
            .ok()
            .filter(|&i| i < count)
            .ok_or_else(|| self.fault(ContentError::Reference { key: key.to_owned(), kind, index, count }))
    }
}

/// Whole numbers, also where a writer spelt them `3.0`.
fn as_uint(value: &Value) -> Option<u64> {
    value.as_u64().or_else(|| {
        let number = value.as_f64()?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked on the same line")]
        (number.fract() == 0.0 && (0.0..9e15).contains(&number)).then_some(number as u64)
    })
}
