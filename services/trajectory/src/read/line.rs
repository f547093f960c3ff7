//! One line of text taken apart into fields, without allocating.

/// The most fields any format is read to; EuRoC's ground truth has 17.
pub(super) const MAX_FIELDS: usize = 32;

/// What a line holds.
#[allow(
    clippy::large_enum_variant,
    reason = "one lives on the stack at a time; a box would allocate for each line"
)]
pub(super) enum Content<'a> {
    /// Only blanks.
    Nothing,
    /// A comment, without its mark.
    Comment(&'a str),
    /// Fields.
    Fields(Fields<'a>),
}

/// The fields of one line.
pub(super) struct Fields<'a> {
    texts: [&'a str; MAX_FIELDS],
    /// How many there are, also those beyond `MAX_FIELDS`.
    count: usize,
    /// Whether commas or semicolons part them.
    pub(super) commas: bool,
}

impl<'a> Fields<'a> {
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// The field at `index`, from 0; empty beyond the last.
    pub(super) fn get(&self, index: usize) -> &'a str {
        self.texts.get(index).copied().unwrap_or("")
    }

    /// Whether the first two fields are words rather than numbers.
    pub(super) fn is_header(&self) -> bool {
        let is_word = |text: &str| {
            text.parse::<f64>().is_err() && text.starts_with(|c: char| !c.is_ascii_digit())
        };
        is_word(self.get(0)) && is_word(self.get(1))
    }
}

/// Takes a line apart.
pub(super) fn content(text: &str) -> Content<'_> {
    let text = text.trim();
    if text.is_empty() {
        return Content::Nothing;
    }
    for mark in ["#", "%", "//"] {
        if let Some(comment) = text.strip_prefix(mark) {
            return Content::Comment(comment);
        }
    }
    let commas = text.contains([',', ';']);
    let mut fields = Fields {
        texts: [""; MAX_FIELDS],
        count: 0,
        commas,
    };
    let mut add = |field| {
        if let Some(place) = fields.texts.get_mut(fields.count) {
            *place = field;
        }
        fields.count += 1;
    };
    if commas {
        // An empty field between two commas is a missing number; one at the end is only a comma.
        let text = text.strip_suffix([',', ';']).unwrap_or(text);
        text.split([',', ';']).map(str::trim).for_each(&mut add);
    } else {
        text.split_ascii_whitespace().for_each(&mut add);
    }
    Content::Fields(fields)
}
