//! Where a value goes in the code of a folder: from its sources by bindings, fields, arguments and results to a comparison.
//!
//! The analysis reads words and signs, knows no types, and takes a name for the same in every file of a folder: rather one statement
//! too many than one too few.

use std::collections::{BTreeMap, BTreeSet};

/// The values that are followed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seeds<'a> {
    /// Functions whose results are such values.
    pub(crate) functions: &'a [&'a str],
    /// Names of such values anywhere.
    pub(crate) names: &'a [&'a str],
    /// Types of such values.
    pub(crate) types: &'a [&'a str],
}

/// Functions that hand their arguments on.
const TRANSPARENT: [&str; 25] = [
    "Ok",
    "Some",
    "abs_diff",
    "add",
    "and_then",
    "checked_add",
    "checked_sub",
    "from",
    "from_micros",
    "from_millis",
    "from_bits",
    "into",
    "map",
    "map_or",
    "max",
    "min",
    "replace",
    "saturating_add",
    "saturating_sub",
    "sub",
    "then_some",
    "try_from",
    "unwrap_or",
    "wrapping_add",
    "wrapping_sub",
];

/// Methods that compare.
const COMPARING: [&str; 10] =
    ["checked_sub", "clamp", "cmp", "contains", "ge", "gt", "le", "lt", "partial_cmp", "total_cmp"];

/// Types that such a value can have: no motor, no answer, no word with a sign.
const NUMBERS: [&str; 11] =
    ["Duration", "Instant", "Tick", "f32", "f64", "u16", "u32", "u64", "u8", "usize", "T"];

#[derive(Debug)]
struct Function {
    name: String,
    /// The names of each parameter but `self`; none of a parameter that is no number.
    parameters: Vec<Vec<String>>,
    result: (usize, usize),
    body: (usize, usize),
}

/// A file of a folder.
#[derive(Debug)]
struct Text {
    tokens: Vec<String>,
    functions: Vec<Function>,
    /// The names in a function that hold such a value, by its number.
    locals: BTreeSet<(usize, String)>,
    /// Those of them that have such a type: so has a parameter that takes one.
    typed: BTreeSet<(usize, String)>,
}

/// The files of a folder, and the names in it that hold such a value.
#[derive(Debug)]
pub(crate) struct Taint<'a> {
    seeds: Seeds<'a>,
    texts: Vec<Text>,
    fields: BTreeSet<String>,
    functions: BTreeSet<String>,
    /// The fields that are declared here; whether one of the name can be such a value.
    declared: BTreeMap<String, bool>,
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

fn is_type(token: &str) -> bool {
    token.starts_with(char::is_uppercase)
        && (token.len() == 1 || token.contains(char::is_lowercase))
}

const KEYWORDS: [&str; 24] = [
    "_", "as", "box", "const", "crate", "dyn", "else", "false", "fn", "for", "if", "impl", "in",
    "let", "loop", "match", "move", "mut", "ref", "return", "self", "super", "true", "where",
];

fn is_variable(token: &str) -> bool {
    is_name(token) && !token.starts_with(char::is_uppercase) && !KEYWORDS.contains(&token)
}

impl Text {
    fn of(tokens: Vec<String>) -> Self {
        let (locals, typed) = (BTreeSet::new(), BTreeSet::new());
        let mut text = Self { tokens, functions: Vec::new(), locals, typed };
        text.functions = (0..text.tokens.len()).filter_map(|at| text.function(at)).collect();
        text
    }

    fn at(&self, place: usize) -> &str {
        self.tokens.get(place).map_or("", String::as_str)
    }

    fn before(&self, place: usize) -> &str {
        place.checked_sub(1).map_or("", |place| self.at(place))
    }

    /// The place of the bracket that closes the one at `open`.
    fn closing(&self, open: usize) -> usize {
        self.partner(open..self.tokens.len()).unwrap_or(self.tokens.len())
    }

    /// The place of the bracket that opens the one at `close`.
    fn opening(&self, close: usize) -> usize {
        self.partner((0..=close).rev()).unwrap_or(0)
    }

    /// The place of the bracket that belongs to the first bracket.
    fn partner(&self, mut places: impl Iterator<Item = usize>) -> Option<usize> {
        let mut depth = 0;
        places.find(|place| {
            let change = match self.at(*place) {
                "(" | "[" | "{" => 1,
                ")" | "]" | "}" => -1,
                _ => 0,
            };
            depth += change;
            change != 0 && depth == 0
        })
    }

    /// The first place from `from` on, outside of brackets that open there, whose token stops; the end of the text otherwise.
    fn until(&self, from: usize, stops: impl Fn(usize, &str) -> bool) -> usize {
        let mut place = from;
        while place < self.tokens.len() {
            let token = self.at(place);
            if stops(place, token) || [")", "]", "}"].contains(&token) {
                return place;
            }
            place = if ["(", "[", "{"].contains(&token) { self.closing(place) } else { place } + 1;
        }
        self.tokens.len()
    }

    /// The parts of a range that commas separate.
    fn parts(&self, from: usize, to: usize) -> Vec<(usize, usize)> {
        let (mut parts, mut begin) = (Vec::new(), from);
        while begin < to {
            let end = self.until(begin, |_, token| token == ",").min(to);
            if end > begin {
                parts.push((begin, end));
            }
            begin = end + 1;
        }
        parts
    }

    /// The names that a pattern brings in.
    fn pattern(&self, from: usize, to: usize) -> Vec<String> {
        let end = self.until(from, |place, token| place >= to || token == ":").min(to);
        let names = (from..end).filter(|place| {
            is_variable(self.at(*place)) && !["(", "::", "{"].contains(&self.at(place + 1))
        });
        names.map(|place| self.at(place).to_owned()).collect()
    }

    /// The names of a parameter that may be a number.
    fn parameter(&self, from: usize, to: usize) -> Vec<String> {
        let is_closure = (from..to).any(|place| self.at(place).starts_with("Fn"));
        if self.is_number(from, to) && !is_closure { self.pattern(from, to) } else { Vec::new() }
    }

    /// Whether a type in a range can be such a value.
    fn is_number(&self, from: usize, to: usize) -> bool {
        (from..to).any(|place| NUMBERS.contains(&self.at(place)))
    }

    fn function(&self, at: usize) -> Option<Function> {
        if self.at(at) != "fn" || !is_name(self.at(at + 1)) {
            return None;
        }
        let open = (at..self.tokens.len()).find(|place| self.at(*place) == "(")?;
        let close = self.closing(open);
        let begin = self.until(close + 1, |_, token| token == "{" || token == ";");
        let end = if self.at(begin) == "{" { self.closing(begin) } else { begin };
        let parameters = self.parts(open + 1, close);
        let has_self = |(from, to): &(usize, usize)| (*from..*to).any(|at| self.at(at) == "self");
        let parameters = parameters.into_iter().filter(|part| !has_self(part));
        Some(Function {
            name: self.at(at + 1).to_owned(),
            parameters: parameters.map(|(from, to)| self.parameter(from, to)).collect(),
            result: (close + 1, begin),
            body: (begin, end),
        })
    }

    /// The number of the innermost function around a place.
    fn around(&self, place: usize) -> Option<usize> {
        let holds =
            |(_, function): &(usize, &Function)| function.body.0 < place && place < function.body.1;
        let inner = self.functions.iter().enumerate().filter(holds);
        inner
            .min_by_key(|(_, function)| function.body.1 - function.body.0)
            .map(|(number, _)| number)
    }

    /// Where the receiver of the method behind the dot at `dot` begins.
    fn receiver(&self, dot: usize) -> usize {
        let mut place = dot;
        while let Some(before) = place.checked_sub(1) {
            match self.at(before) {
                ")" | "]" => place = self.opening(before),
                "." | "?" | "::" => place = before,
                token if is_name(token) && token != "return" && token != "in" => {
                    if place < dot && ![".", "::", "(", "[", "?"].contains(&self.at(place)) {
                        break;
                    }
                    place = before;
                }
                _ => break,
            }
        }
        place
    }

    /// Whether a sign at a place stands alone: no part of an arrow, a shift, an assignment or a longer sign.
    fn is_comparison(&self, place: usize) -> bool {
        let (before, sign, after) = (self.before(place), self.at(place), self.at(place + 1));
        match sign {
            "<" => before != "<" && after != "<" && !self.opens_types(place),
            ">" => !["-", "=", ">"].contains(&before) && after != ">" && !self.closes_types(place),
            "=" => after == "=" && !["<", ">", "=", "!"].contains(&before),
            "!" => after == "=",
            _ => false,
        }
    }

    fn opens_types(&self, place: usize) -> bool {
        let before = self.before(place);
        is_type(before) || before == "::" || before == "impl" || self.before(place - 1) == "fn"
    }

    fn closes_types(&self, place: usize) -> bool {
        let mut depth = 1;
        for before in (0..place).rev() {
            match self.at(before) {
                ">" if !["-", "="].contains(&self.before(before)) => depth += 1,
                "<" if self.opens_types(before) => {
                    depth -= 1;
                    if depth == 0 {
                        return true;
                    }
                }
                ";" | "{" | "}" => return false,
                _ => {}
            }
        }
        false
    }

    /// The end of the calls and fields behind a name, if one of them asks whether something is so.
    fn truth(&self, place: usize, to: usize) -> Option<usize> {
        let (mut place, mut asks) = (place + 1, false);
        loop {
            match self.at(place) {
                _ if place >= to => return asks.then_some(place),
                "(" | "[" => place = self.closing(place) + 1,
                "?" => place += 1,
                "." if is_name(self.at(place + 1)) => {
                    asks |= ["is_", "has_"].iter().any(|word| self.at(place + 1).starts_with(word));
                    place += 2;
                }
                _ => return asks.then_some(place),
            }
        }
    }

    /// Whether a range is a truth, or a product of two quantities: no longer a time, nor a count.
    fn is_other(&self, from: usize, to: usize) -> bool {
        let mut place = from;
        while place < to {
            let token = self.at(place);
            if ["(", "[", "{"].contains(&token) {
                place = self.closing(place) + 1;
                continue;
            }
            let follows = is_name(self.before(place)) || [")", "]"].contains(&self.before(place));
            let is_product = ["*", "/"].contains(&token) && place > from && follows;
            let is_logic = ["&", "|"].contains(&token) && self.at(place + 1) == token;
            if is_logic || self.is_comparison(place) || is_product && !self.is_scaled(place) {
                return true;
            }
            place += 1;
        }
        false
    }

    /// Whether a product has a constant on one side.
    fn is_scaled(&self, place: usize) -> bool {
        let is_constant = |token: &str| {
            token.starts_with(|c: char| c.is_ascii_digit())
                || is_name(token) && !token.contains(char::is_lowercase)
        };
        let after = (place + 1..).find(|at| !["Self", "::"].contains(&self.at(*at)));
        is_constant(self.before(place)) || after.is_some_and(|at| is_constant(self.at(at)))
    }

    /// The operands on both sides of a comparison.
    fn operands(&self, place: usize) -> (usize, usize) {
        let ends = |at: usize, token: &str| match token {
            ";" | "{" | "}" | "," | "let" | "if" | "while" | "match" | "return" | "|" | "else"
            | "!" => true,
            "&" => self.at(at + 1) == "&" || self.before(at) == "&",
            "=" => !["<", ">", "=", "!"].contains(&self.before(at)) && self.at(at + 1) != "=",
            ">" => self.before(at) == "=",
            _ => false,
        };
        let mut from = place;
        while let Some(before) = from.checked_sub(1) {
            let token = self.at(before);
            match token {
                ")" | "]" => from = self.opening(before),
                "(" | "[" => break,
                _ if ends(before, token) => break,
                _ => from = before,
            }
        }
        (from, self.until(place + 1, |at, token| ends(at, token) && at > place + 1))
    }
}

impl<'a> Taint<'a> {
    /// Follows the values through the files of a folder.
    pub(crate) fn of(seeds: Seeds<'a>, files: impl Iterator<Item = Vec<String>>) -> Self {
        let texts = files.map(Text::of).collect();
        let mut taint = Self {
            seeds,
            texts,
            fields: BTreeSet::new(),
            functions: BTreeSet::new(),
            declared: BTreeMap::new(),
        };
        taint.declare();
        loop {
            let before = taint.size();
            for text in 0..taint.texts.len() {
                taint.follow(text);
            }
            if taint.size() == before {
                return taint;
            }
        }
    }

    fn size(&self) -> usize {
        let locals: usize = self.texts.iter().map(|text| text.locals.len()).sum();
        self.fields.len() + self.functions.len() + locals
    }

    fn is_seed(&self, token: &str) -> bool {
        self.seeds.types.contains(&token)
    }

    /// Fields, variants, parameters and results by their types.
    fn declare(&mut self) {
        let (mut fields, mut functions) = (BTreeSet::new(), BTreeSet::new());
        let mut declared = BTreeMap::new();
        for number in 0..self.texts.len() {
            let text = &self.texts[number];
            let mut locals = BTreeSet::new();
            for (function, definition) in text.functions.iter().enumerate() {
                let (from, to) = definition.result;
                if (from..to).any(|place| self.is_seed(text.at(place))) {
                    functions.insert(definition.name.clone());
                }
                let open = text.opening(from - 1);
                for (from, to) in text.parts(open + 1, from - 1) {
                    if (from..to).any(|place| self.is_seed(text.at(place))) {
                        let names = text.pattern(from, to);
                        locals.extend(names.into_iter().map(|name| (function, name)));
                    }
                }
            }
            for place in (0..text.tokens.len()).filter(|place| text.around(*place).is_none()) {
                let is_field = is_name(text.at(place)) && text.at(place + 1) == ":";
                let end = text.until(place + 1, |_, token| [",", ";", "="].contains(&token));
                let has_seed = |from: usize, to| (from..to).any(|at| self.is_seed(text.at(at)));
                let is_variant = is_type(text.at(place)) && text.at(place + 1) == "(";
                let is_field = is_field
                    && (place..end).all(|at| text.at(at) != "{")
                    && ["{", ",", "pub", ")", "]"].contains(&text.before(place));
                if is_field {
                    let is_number = text.is_number(place + 1, end) || has_seed(place + 1, end);
                    *declared.entry(text.at(place).to_owned()).or_insert(false) |= is_number;
                }
                if is_field && has_seed(place + 1, end)
                    || is_variant && has_seed(place + 1, text.closing(place + 1))
                {
                    fields.insert(text.at(place).to_owned());
                }
            }
            self.texts[number].typed.clone_from(&locals);
            self.texts[number].locals = locals;
        }
        self.fields = fields;
        self.functions = functions;
        self.declared = declared;
    }

    /// Whether a range is such a value.
    fn has(&self, text: &Text, from: usize, to: usize) -> bool {
        match text.at(from) {
            "if" | "match" => self.ends_in_one(text, from, to),
            _ => !text.is_other(from, to) && self.names_one(text, from, to),
        }
    }

    /// Whether a range names such a value, outside of the arguments of functions that keep them.
    fn names_one(&self, text: &Text, from: usize, to: usize) -> bool {
        let mut place = from;
        while place < to {
            let token = text.at(place);
            let next = text.at(place + 1);
            if is_name(token) && next == "(" {
                let has_arguments = text.at(place + 2) != ")" || token != "since";
                let is_seed = self.seeds.functions.contains(&token) && has_arguments;
                if is_seed || self.functions.contains(token) || self.holds(text, place) {
                    match text.truth(place, to) {
                        Some(end) => place = end,
                        None => return true,
                    }
                    continue;
                }
                place = match TRANSPARENT.contains(&token) {
                    true => place + 1,
                    false => text.closing(place + 1) + 1,
                };
                continue;
            }
            // A struct is not its fields.
            if (is_type(token) || token == "Self") && next == "{" {
                place = text.closing(place + 1) + 1;
                continue;
            }
            if is_name(token) && self.holds(text, place) {
                match text.truth(place, to) {
                    Some(end) => place = end,
                    None => return true,
                }
                continue;
            }
            place += 1;
        }
        false
    }

    /// Whether the name at a place holds such a value.
    fn holds(&self, text: &Text, place: usize) -> bool {
        let name = text.at(place);
        if self.seeds.names.contains(&name) {
            return true;
        }
        if text.before(place) == "." {
            return self.fields.contains(name);
        }
        let function = text.around(place);
        function.is_some_and(|function| text.locals.contains(&(function, name.to_owned())))
    }

    fn follow(&mut self, number: usize) {
        let (mut names, mut fields) = (Vec::new(), Vec::new());
        let (mut parameters, mut functions) = (Vec::new(), Vec::new());
        let text = &self.texts[number];
        for (function, definition) in text.functions.iter().enumerate() {
            let (from, to) = definition.body;
            for place in from..to {
                if text.around(place) != Some(function) {
                    continue;
                }
                self.bind(text, place, &mut names, &mut fields);
                self.assign(text, place, &mut names, &mut fields);
                self.construct(text, place, &mut names, &mut fields);
                self.call(text, place, &mut parameters);
            }
            names.drain(..).for_each(|name| functions.push((function, name)));
            let (result, end) = definition.result;
            if text.is_number(result, end) && self.results(text, from, to) {
                fields.push(format!("fn {}", definition.name));
            }
        }
        self.texts[number].locals.extend(functions);
        for field in fields {
            match field.strip_prefix("fn ") {
                Some(function) => self.functions.insert(function.to_owned()),
                None if self.declared.get(&field) == Some(&false) => false,
                None => self.fields.insert(field),
            };
        }
        for (name, place, count) in parameters {
            for text in &mut self.texts {
                let named = text.functions.iter().enumerate().filter(|(_, function)| {
                    function.name == name && function.parameters.len() == count
                });
                let names = named.filter_map(|(function, definition)| {
                    Some((function, definition.parameters.get(place)?.clone()))
                });
                let names: Vec<_> = names.collect();
                for (function, names) in names {
                    text.locals.extend(names.into_iter().map(|name| (function, name)));
                }
            }
        }
    }

    /// Bindings: `let`, `for`, the arms of a `match`, the parameters of a closure.
    fn bind(&self, text: &Text, place: usize, names: &mut Vec<String>, _: &mut [String]) {
        match text.at(place) {
            "let" => {
                let is_sign = |at: usize, token: &str| {
                    token == "=" && text.at(at + 1) != "=" && text.at(at + 1) != ">"
                };
                let sign = text.until(place + 1, is_sign);
                let is_condition = ["if", "while", "&"].contains(&text.before(place));
                let end = text.until(sign + 1, |at, token| match token {
                    ";" => true,
                    "{" => is_condition || text.before(at) == "else",
                    "&" => is_condition && text.at(at + 1) == "&",
                    _ => false,
                });
                self.pair(text, (place + 1, sign), (sign + 1, end), &mut |(from, to)| {
                    names.extend(text.pattern(from, to));
                });
            }
            "for" => {
                let within = text.until(place + 1, |_, token| token == "in" || token == "{");
                let end = text.until(within + 1, |_, token| token == "{");
                if text.at(within) == "in" && self.has(text, within + 1, end) {
                    names.extend(text.pattern(place + 1, within));
                }
            }
            "match" => {
                let open = text.until(place + 1, |_, token| token == "{");
                if self.has(text, place + 1, open) {
                    self.arms(text, open, &mut |from, to| names.extend(text.pattern(from, to)));
                }
            }
            "|" if text.before(place) == "(" || text.before(place) == "move" => {
                let open = if text.before(place) == "(" { place - 1 } else { place - 2 };
                let Some(dot) = open.checked_sub(2).filter(|dot| text.at(*dot) == ".") else {
                    return;
                };
                let end = text.until(place + 1, |_, token| token == "|");
                if self.has(text, text.receiver(dot), dot) {
                    names.extend(text.pattern(place + 1, end));
                }
            }
            variant
                if self.fields.contains(variant)
                    && is_type(variant)
                    && text.at(place + 1) == "(" =>
            {
                names.extend(text.pattern(place + 2, text.closing(place + 1)));
            }
            _ => {}
        }
    }

    /// Hands on each pattern of a `match`.
    fn arms(&self, text: &Text, open: usize, take: &mut dyn FnMut(usize, usize)) {
        let close = text.closing(open);
        let mut place = open + 1;
        while place < close {
            let is_arrow = |at: usize, token: &str| token == "=" && text.at(at + 1) == ">";
            let arrow = text.until(place, is_arrow);
            if arrow >= close {
                return;
            }
            take(place, arrow);
            let body = arrow + 2;
            let end = if text.at(body) == "{" {
                text.closing(body)
            } else {
                text.until(body, |_, token| token == ",")
            };
            place = end + 1;
            if text.at(place) == "," {
                place += 1;
            }
        }
    }

    /// Hands on what takes such a value: of two tuples, by places.
    fn pair(
        &self,
        text: &Text,
        left: (usize, usize),
        right: (usize, usize),
        take: &mut dyn FnMut((usize, usize)),
    ) {
        let inner = |(from, to): (usize, usize)| {
            let is_tuple = text.at(from) == "(" && text.closing(from) + 1 == to;
            is_tuple.then(|| text.parts(from + 1, to - 1))
        };
        match (inner(left), inner(right)) {
            (Some(left), Some(right)) if left.len() == right.len() => {
                left.into_iter()
                    .zip(right)
                    .for_each(|(left, right)| self.pair(text, left, right, take));
            }
            _ if self.has(text, right.0, right.1) => take(left),
            _ => {}
        }
    }

    fn assign(&self, text: &Text, place: usize, names: &mut Vec<String>, fields: &mut Vec<String>) {
        let Some((left, right)) = assignment(text, place) else { return };
        self.pair(text, left, right, &mut |(from, to)| {
            for (from, to) in text.parts(from + usize::from(text.at(from) == "("), to) {
                let last = (from..to).rev().find(|at| is_name(text.at(*at)));
                let Some(last) = last else { continue };
                let name = text.at(last).to_owned();
                if text.before(last) == "." { fields.push(name) } else { names.push(name) }
            }
        });
    }

    /// The fields of a struct that is made.
    fn construct(&self, text: &Text, place: usize, _: &mut [String], fields: &mut Vec<String>) {
        let is_made = |open: usize| is_type(text.before(open)) || text.before(open) == "Self";
        if text.at(place) != "{" || !is_made(place) {
            return;
        }
        for (from, to) in text.parts(place + 1, text.closing(place)) {
            let value = if text.at(from + 1) == ":" { from + 2 } else { from };
            if is_variable(text.at(from)) && self.has(text, value, to) {
                fields.push(text.at(from).to_owned());
            }
        }
    }

    /// Arguments of a function of the folder.
    fn call(&self, text: &Text, place: usize, parameters: &mut Vec<(String, usize, usize)>) {
        let name = text.at(place);
        if !is_variable(name) || text.at(place + 1) != "(" {
            return;
        }
        let arguments = text.parts(place + 2, text.closing(place + 1));
        let count = arguments.len();
        for (index, (from, to)) in arguments.into_iter().enumerate() {
            let is_closure = text.at(from) == "|" || text.at(from) == "move";
            let local = text.around(from).map(|function| (function, text.at(from).to_owned()));
            let is_call = ["now", "updated"].contains(&text.at(to.saturating_sub(3)));
            let is_typed = from + 1 == to && local.is_some_and(|local| text.typed.contains(&local));
            let is_typed = is_typed || is_call && text.at(to - 2) == "(";
            if !is_closure && !is_typed && self.has(text, from, to) {
                parameters.push((name.to_owned(), index, count));
            }
        }
    }

    /// Whether a block results in such a value, or returns one.
    fn results(&self, text: &Text, open: usize, close: usize) -> bool {
        let returns = (open..close).filter(|place| text.at(*place) == "return");
        let mut ends =
            returns.map(|place| (place + 1, text.until(place + 1, |_, token| token == ";")));
        ends.any(|(from, to)| self.has(text, from, to)) || self.ends_in_one(text, open + 1, close)
    }

    /// Whether the last expression of a range is such a value: of each branch.
    fn ends_in_one(&self, text: &Text, from: usize, to: usize) -> bool {
        let (mut last, mut place) = (from, from);
        while place < to {
            let token = text.at(place);
            if token == ";" {
                last = place + 1;
            }
            if ["(", "[", "{"].contains(&token) {
                let close = text.closing(place);
                let next = text.at(close + 1);
                let ends =
                    token == "{" && (is_name(next) && next != "else" || next == "(" || next == "*");
                if ends && close + 1 < to {
                    last = close + 1;
                }
                place = close;
            }
            place += 1;
        }
        match text.at(last) {
            "if" => {
                let mut place = last;
                while place < to {
                    let open = text.until(place, |_, token| token == "{");
                    if open >= to {
                        return false;
                    }
                    let close = text.closing(open);
                    if self.ends_in_one(text, open + 1, close) {
                        return true;
                    }
                    place = close + 1;
                }
                false
            }
            "match" => {
                let open = text.until(last, |_, token| token == "{");
                let mut found = false;
                self.arms(text, open, &mut |_, arrow| {
                    let body = arrow + 2;
                    let end = text.until(body, |_, token| token == ",");
                    found |= self.has(text, body, end);
                });
                found
            }
            _ => last < to && self.has(text, last, to),
        }
    }

    /// The comparisons of such a value, each with the number of its file.
    pub(crate) fn judgements(&self) -> BTreeSet<(usize, String)> {
        let mut found = BTreeSet::new();
        for (number, text) in self.texts.iter().enumerate() {
            for place in 0..text.tokens.len() {
                if text.around(place).is_none() {
                    continue;
                }
                let token = text.at(place);
                let is_method = COMPARING.contains(&token)
                    && text.before(place) == "."
                    && text.at(place + 1) == "(";
                let range = if text.is_comparison(place) {
                    Some(text.operands(place))
                } else if is_method {
                    Some((text.receiver(place - 1), text.closing(place + 1) + 1))
                } else if token == "match" {
                    self.matched(text, place)
                } else {
                    None
                };
                let Some((from, to)) = range else { continue };
                let has_argument = is_method && self.names_one(text, place + 2, to);
                if token == "match" || has_argument || self.names_one(text, from, to) {
                    found.insert((number, text.tokens[from..to].join(" ")));
                }
            }
        }
        found
    }

    /// The value that a `match` compares with numbers.
    fn matched(&self, text: &Text, place: usize) -> Option<(usize, usize)> {
        let open = text.until(place + 1, |_, token| token == "{");
        let mut compares = false;
        self.arms(text, open, &mut |from, to| {
            let is_number = |at: usize| text.at(at).starts_with(|c: char| c.is_ascii_digit());
            let is_range = |at: usize| text.at(at) == "." && text.at(at + 1) == ".";
            let is_guard = |at: usize| text.at(at) == "if";
            let end = (from..to).find(|at| is_guard(*at)).unwrap_or(to);
            compares |= (from..end).any(|at| {
                is_number(at) || is_range(at) && text.before(at) != "{" && text.before(at) != ","
            });
        });
        (compares && self.has(text, place + 1, open)).then_some((place + 1, open))
    }
}

/// Both sides of the assignment whose sign is at a place.
fn assignment(text: &Text, place: usize) -> Option<((usize, usize), (usize, usize))> {
    let before = text.before(place);
    let is_shift = ["<", ">"].contains(&before) && text.before(place - 1) == before;
    let is_sign = text.at(place) == "="
        && (is_shift || !["=", "<", ">", "!"].contains(&before))
        && !["=", ">"].contains(&text.at(place + 1));
    if !is_sign {
        return None;
    }
    let is_compound = is_shift || ["+", "-", "*", "/", "|", "&", "%", "^"].contains(&before);
    let end = place - usize::from(is_compound) - usize::from(is_shift);
    let mut from = end;
    while let Some(before) = from.checked_sub(1) {
        match text.at(before) {
            ")" | "]" => from = text.opening(before),
            ";" | "{" | "}" | ">" | "," | "(" => break,
            "let" | ":" | "const" | "static" | "type" => return None,
            _ => from = before,
        }
    }
    let right = text.until(place + 1, |_, token| token == ";" || token == ",");
    // A compound sign reads its left side too.
    Some(((from, end), (if is_compound { from } else { place + 1 }, right)))
}

/// The fields that count: by a sum, a difference, a product, a quotient or a shift of themselves.
pub(crate) fn counting_in(tokens: &[String]) -> BTreeSet<String> {
    let text = Text::of(tokens.to_vec());
    let mut found = BTreeSet::new();
    for place in 0..text.tokens.len() {
        let counts = |from: usize, to: usize, name: &str| {
            let is_sum = |at: usize| {
                let follows = [")", "]"].contains(&text.before(at))
                    || text.before(at).starts_with(|c: char| c.is_alphanumeric() || c == '_');
                let is_shift = ["<", ">"].contains(&text.at(at)) && text.at(at + 1) == text.at(at);
                let is_sign = is_shift || ["+", "-", "*", "/"].contains(&text.at(at));
                let sign = is_sign && at > from && follows;
                let calls = ["saturating_", "wrapping_", "checked_", "overflowing_"];
                let ends = ["add", "sub"];
                let call = calls.iter().any(|call| text.at(at).starts_with(call));
                sign || call && ends.iter().any(|end| text.at(at).ends_with(end))
            };
            (from..to).any(|at| text.at(at) == name) && (from..to).any(is_sum)
        };
        if let Some(((from, end), (right, to))) = assignment(&text, place) {
            let Some(last) = (from..end).rev().find(|at| is_name(text.at(*at))) else { continue };
            let is_field = text.before(last) == "." || text.at(from) == "*";
            let is_whole = text.at(last) == "self";
            if is_field && !is_whole && counts(right, to, text.at(last)) {
                found.insert(text.at(last).to_owned());
            }
        }
        let is_made = ["{", ","].contains(&text.before(place)) && text.at(place + 1) == ":";
        if is_made && is_variable(text.at(place)) && text.around(place).is_some() {
            let end = text.until(place + 2, |_, token| token == ",");
            let is_same = |at: usize| text.at(at) == text.at(place) && text.before(at) == ".";
            if (place + 2..end).any(is_same) && counts(place + 2, end, text.at(place)) {
                found.insert(text.at(place).to_owned());
            }
        }
    }
    found
}

/// The fields and variants that a file declares.
pub(crate) fn declared_in(tokens: &[String]) -> BTreeSet<String> {
    let text = Text::of(tokens.to_vec());
    let mut found = BTreeSet::new();
    for place in 0..text.tokens.len() {
        if !["struct", "enum"].contains(&text.at(place)) || text.around(place).is_some() {
            continue;
        }
        let open = text.until(place + 1, |_, token| token == ";" || token == "{");
        if text.at(open) != "{" {
            continue;
        }
        for (from, to) in text.parts(open + 1, text.closing(open)) {
            let mut at = from;
            while text.at(at) == "#" {
                at = text.closing(at + 1) + 1;
            }
            if text.at(at) == "pub" {
                at = if text.at(at + 1) == "(" { text.closing(at + 1) } else { at } + 1;
            }
            if at < to {
                found.insert(text.at(at).to_owned());
            }
        }
    }
    found
}

/// The words of a name, in lower case.
pub(crate) fn words_of(name: &str) -> Vec<String> {
    let is_constant = !name.contains(char::is_lowercase);
    let mut words = vec![String::new()];
    for letter in name.chars() {
        if letter == '_' || letter.is_uppercase() && !is_constant {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| letter != '_') {
            word.extend(letter.to_lowercase());
        }
    }
    words.retain(|word| !word.is_empty());
    words
}
