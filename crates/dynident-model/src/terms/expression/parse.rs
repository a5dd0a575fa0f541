//! Recursive-descent parser of expressions. `-q^2` is `-(q^2)`, `2^-1` is 0.5, `a^b^c` is `a^(b^c)`.

use super::operations::{ExpressionFunction, ExpressionFunction2, ExpressionNode, value};
use super::{MAX_OPERATIONS, MAX_VALUE};
use thiserror::Error;

/// Maximum length, characters; sufficient for the maximum number of operations with all digits of their numbers.
const MAX_CHARACTERS: usize = 10_000;
const MAX_SHOWN_CHARACTERS: usize = 2000;
/// Maximum nesting of parentheses, functions and signs, each of which uses a stack frame.
const MAX_DEPTH: usize = 64;
/// Largest integer exponent that is computed by products; larger ones are powers with a nonnegative base.
const MAX_INTEGER_EXPONENT: f64 = 64.0;

/// Names of joints in an expression.
#[derive(Clone, Copy, Debug)]
pub struct JointNames<'a> {
    /// Index of the joint whose position and velocity are `q` and `dq`.
    pub own: Option<usize>,
    /// Names of the joints; if empty, joints have only numbers, without an upper limit.
    pub names: &'a [String],
}

/// The `expression` of a `[[torque]]` has a mistake at this character, counted from 1. The text after the place has the
/// cause; see *Mistakes in expressions* below.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("`{text}`, character {character}: {problem}")]
pub struct ExpressionError {
    /// The expression.
    pub text: String,
    /// Position of the mistake, in characters from 1.
    pub character: usize,
    /// The error, with the fix.
    #[source]
    pub problem: ExpressionProblem,
}

/// Kind of a parse error.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum ExpressionProblem {
    /// The expression exceeds the size that Dynident reads. Simplify it, or give the torque as a `table` over the
    /// position.
    #[error("more than {most} {of}: write a shorter expression, or a table")]
    TooLong { most: usize, of: &'static str },
    /// A bracket, an operator or an operand is missing or extra at this place.
    #[error("{found} where {expected} is expected")]
    Expected { expected: &'static str, found: String },
    /// The expression uses a name that is not a position, a velocity, a constant or a known function. Correct its
    /// spelling.
    #[error(
        "unknown name `{name}`: position and velocity are q and dq, those of other joints q(NAME) or q1, q2, ..; functions are {}",
        functions()
    )]
    Name { name: String },
    /// The expression names a joint that the robot does not have. Use one of the listed names or its number, counted
    /// from 1.
    #[error("there is no joint {joint}: the joints are {}", known.join(", "))]
    Joint { joint: String, known: Vec<String> },
    /// `q` or `dq` is written without a joint, in an expression that does not belong to one joint. Write the number of
    /// the joint, counted from 1.
    #[error("the joint of {name} is missing: write {name}1, {name}2, ..")]
    WhichJoint { name: &'static str },
    /// `^` permits only a constant exponent. Write a variable exponent with `exp` and `ln`.
    #[error("the exponent is not a constant: write exp(exponent * ln(base))")]
    Exponent,
    /// A number or an exponent in the expression is too large. Write a smaller one.
    #[error("{what} is not finite or exceeds 1e12 in magnitude")]
    Value { what: &'static str },
}

fn functions() -> String {
    let of_one = ExpressionFunction::ALL.map(ExpressionFunction::name).into_iter();
    of_one.chain(ExpressionFunction2::ALL.map(ExpressionFunction2::name)).collect::<Vec<_>>().join(", ")
}

pub(super) fn parse(text: &str, joints: &JointNames<'_>) -> Result<Vec<ExpressionNode>, ExpressionError> {
    let shown: String = text.chars().take(MAX_SHOWN_CHARACTERS).map(|c| if c.is_control() { ' ' } else { c }).collect();
    let mut parser = Parser { characters: text.chars().take(MAX_CHARACTERS + 1).collect(), ..Parser::new(joints) };
    let parsed = if parser.characters.len() > MAX_CHARACTERS {
        Err(ExpressionProblem::TooLong { most: MAX_CHARACTERS, of: "characters" })
    } else {
        parser.whole()
    };
    parsed.map_err(|problem| ExpressionError { text: shown, character: parser.begin + 1, problem })?;
    Ok(parser.nodes)
}

struct Parser<'a> {
    characters: Vec<char>,
    at: usize,
    /// Start of the current word; an error is reported at this position.
    begin: usize,
    depth: usize,
    nodes: Vec<ExpressionNode>,
    joints: &'a JointNames<'a>,
}

type Parsed<T = usize> = Result<T, ExpressionProblem>;

impl<'a> Parser<'a> {
    fn new(joints: &'a JointNames<'a>) -> Self {
        Self { characters: Vec::new(), at: 0, begin: 0, depth: 0, nodes: Vec::new(), joints }
    }

    fn whole(&mut self) -> Parsed<()> {
        self.sum()?;
        match self.peek() {
            None => Ok(()),
            Some(_) => Err(self.expected("an operator (+ - * / ^) or the end")),
        }
    }

    /// The next character that is not a space; an error would be reported at this position.
    fn peek(&mut self) -> Option<char> {
        while self.characters.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.begin = self.at;
        self.characters.get(self.at).copied()
    }

    fn take(&mut self, wanted: char) -> bool {
        let is_there = self.peek() == Some(wanted);
        self.at += usize::from(is_there);
        is_there
    }

    fn need(&mut self, wanted: char, expected: &'static str) -> Parsed<()> {
        if self.take(wanted) { Ok(()) } else { Err(self.expected(expected)) }
    }

    fn expected(&mut self, expected: &'static str) -> ExpressionProblem {
        let found = self.peek().map_or_else(|| "the end".to_owned(), |c| format!("`{c}`"));
        ExpressionProblem::Expected { expected, found }
    }

    fn push(&mut self, node: ExpressionNode) -> Parsed {
        if self.nodes.len() == MAX_OPERATIONS {
            return Err(ExpressionProblem::TooLong { most: MAX_OPERATIONS, of: "operations" });
        }
        self.nodes.push(node);
        Ok(self.nodes.len() - 1)
    }

    fn deeper<T>(&mut self, read: impl FnOnce(&mut Self) -> Parsed<T>) -> Parsed<T> {
        if self.depth == MAX_DEPTH {
            return Err(ExpressionProblem::TooLong { most: MAX_DEPTH, of: "parentheses and signs within each other" });
        }
        self.depth += 1;
        let result = read(self);
        self.depth -= 1;
        result
    }

    fn sum(&mut self) -> Parsed {
        let mut left = self.product()?;
        loop {
            if self.take('+') {
                let right = self.product()?;
                left = self.push(ExpressionNode::Add(left, right))?;
            } else if self.take('-') {
                let right = self.product()?;
                left = self.push(ExpressionNode::Subtract(left, right))?;
            } else {
                return Ok(left);
            }
        }
    }

    fn product(&mut self) -> Parsed {
        let mut left = self.signed()?;
        loop {
            if self.take('*') {
                let right = self.signed()?;
                left = self.push(ExpressionNode::Multiply(left, right))?;
            } else if self.take('/') {
                let right = self.signed()?;
                left = self.push(ExpressionNode::Divide(left, right))?;
            } else {
                return Ok(left);
            }
        }
    }

    fn signed(&mut self) -> Parsed {
        if self.take('-') {
            let of = self.deeper(Self::signed)?;
            return match self.nodes[of] {
                ExpressionNode::Number(number) => {
                    self.nodes[of] = ExpressionNode::Number(-number);
                    Ok(of)
                }
                _ => self.push(ExpressionNode::Negate(of)),
            };
        }
        if self.take('+') { self.deeper(Self::signed) } else { self.power() }
    }

    fn power(&mut self) -> Parsed {
        let base = self.atom()?;
        if !self.take('^') {
            return Ok(base);
        }
        let place = self.at;
        let first = self.nodes.len();
        self.deeper(Self::signed)?;
        let exponent = number_of(&self.nodes[first..], first);
        self.nodes.truncate(first);
        self.begin = place;
        let exponent = exponent.ok_or(ExpressionProblem::Exponent)?;
        if exponent.is_nan() || exponent.abs() > MAX_VALUE {
            return Err(ExpressionProblem::Value { what: "the exponent" });
        }
        let is_product = exponent.fract() == 0.0 && exponent.abs() <= MAX_INTEGER_EXPONENT;
        self.push(if is_product {
            ExpressionNode::WholePower(base, exponent as i32)
        } else {
            ExpressionNode::Power(base, exponent)
        })
    }

    fn atom(&mut self) -> Parsed {
        match self.peek() {
            Some('(') => {
                self.at += 1;
                let inside = self.deeper(Self::sum)?;
                self.need(')', "`)` or an operator")?;
                Ok(inside)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.named(),
            _ => Err(self.expected("a number, a name or `(`")),
        }
    }

    fn number(&mut self) -> Parsed {
        let begin = self.at;
        let digits = |parser: &mut Self| {
            while parser.characters.get(parser.at).is_some_and(char::is_ascii_digit) {
                parser.at += 1;
            }
        };
        digits(self);
        if self.characters.get(self.at) == Some(&'.') {
            self.at += 1;
            digits(self);
        }
        if matches!(self.characters.get(self.at), Some('e' | 'E')) {
            let sign = usize::from(matches!(self.characters.get(self.at + 1), Some('+' | '-')));
            if self.characters.get(self.at + 1 + sign).is_some_and(char::is_ascii_digit) {
                self.at += 1 + sign;
                digits(self);
            }
        }
        let text: String = self.characters[begin..self.at].iter().collect();
        match text.parse::<f64>() {
            Ok(number) if number <= MAX_VALUE => self.push(ExpressionNode::Number(number)),
            _ => Err(ExpressionProblem::Value { what: "the number" }),
        }
    }

    fn word(&mut self) -> String {
        let begin = self.at;
        while self.characters.get(self.at).is_some_and(|c| c.is_alphanumeric() || *c == '_') {
            self.at += 1;
        }
        self.characters[begin..self.at].iter().collect()
    }

    fn named(&mut self) -> Parsed {
        let begin = self.at;
        let name = self.word();
        if name == "pi" {
            return self.push(ExpressionNode::Number(core::f64::consts::PI));
        }
        if let Some(function) = ExpressionFunction::ALL.into_iter().find(|function| function.name() == name) {
            self.need('(', "`(` of a function")?;
            let of = self.deeper(Self::sum)?;
            self.need(')', "`)` of a function of one value")?;
            return self.push(ExpressionNode::Call(function, of));
        }
        if let Some(function) = ExpressionFunction2::ALL.into_iter().find(|function| function.name() == name) {
            self.need('(', "`(` of a function")?;
            let first = self.deeper(Self::sum)?;
            self.need(',', "`,` and the second value")?;
            let second = self.deeper(Self::sum)?;
            self.need(')', "`)` of a function of two values")?;
            return self.push(ExpressionNode::Call2(function, first, second));
        }
        for quantity in ["dq", "q"] {
            let Some(rest) = name.strip_prefix(quantity) else { continue };
            let joint = if rest.is_empty() {
                if self.take('(') {
                    self.joint_by_name()?
                } else {
                    self.begin = begin;
                    self.joints.own.ok_or(ExpressionProblem::WhichJoint { name: quantity })?
                }
            } else if rest.bytes().all(|digit| digit.is_ascii_digit()) {
                self.begin = begin;
                self.joint_by_number(rest)?
            } else {
                continue;
            };
            return self.push(if quantity == "q" {
                ExpressionNode::Position(joint)
            } else {
                ExpressionNode::Velocity(joint)
            });
        }
        self.begin = begin;
        Err(ExpressionProblem::Name { name })
    }

    fn joint_by_number(&self, digits: &str) -> Parsed {
        let most = if self.joints.names.is_empty() { usize::from(u16::MAX) } else { self.joints.names.len() };
        match digits.parse::<usize>() {
            Ok(number) if (1..=most).contains(&number) => Ok(number - 1),
            _ => Err(self.no_joint(format!("number {digits}"))),
        }
    }

    /// Parses the name of a joint after `q(`, up to `)` or in quotes.
    fn joint_by_name(&mut self) -> Parsed {
        let quote = self.peek().filter(|c| matches!(c, '"' | '\''));
        self.at += usize::from(quote.is_some());
        let begin = self.at;
        let end = quote.unwrap_or(')');
        while self.characters.get(self.at).is_some_and(|c| *c != end) {
            self.at += 1;
        }
        let written: String = self.characters[begin..self.at].iter().collect();
        let name = if quote.is_some() { &written[..] } else { written.trim() };
        if quote.is_some() {
            self.need(end, "the quote that ends the joint's name")?;
        }
        self.need(')', "`)` behind the joint's name")?;
        self.begin = begin;
        let place = self.joints.names.iter().position(|known| known == name);
        place.ok_or_else(|| self.no_joint(format!("`{name}`")))
    }

    fn no_joint(&self, joint: String) -> ExpressionProblem {
        let known =
            if self.joints.names.is_empty() { vec!["numbered from 1".to_owned()] } else { self.joints.names.to_vec() };
        ExpressionProblem::Joint { joint, known }
    }
}

/// Value of operations that contain no joints; `first` is the index of the first operation.
fn number_of(nodes: &[ExpressionNode], first: usize) -> Option<f64> {
    if nodes.iter().any(|node| matches!(node, ExpressionNode::Position(_) | ExpressionNode::Velocity(_))) {
        return None;
    }
    let mut values = vec![0.0; first];
    for node in nodes {
        let next = value(*node, &values);
        values.push(next);
    }
    values.last().copied()
}
