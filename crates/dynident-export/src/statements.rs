//! Converts a graph to the lines of a function. The lines contain only values that the outputs need. A short value
//! that is used once is written where it is used.

use crate::graph::{Function, Function2, Graph, Id, Input, Node};
use crate::symbol::Symbol;

const MAX_INLINE_CHARACTERS: usize = 48;

pub(crate) trait Syntax {
    /// An entry of a joint vector; joints are numbered from zero.
    fn input(&self, input: Input, joint: usize) -> String;

    fn call(&self, function: Function, of: &str) -> String;

    fn call2(&self, function: Function2, first: &str, second: &str) -> String;

    fn power(&self, of: &str, exponent: f64) -> String;

    /// Sign of `of`; zero if its magnitude is at most `dead_band`.
    fn step(&self, of: &str, dead_band: f64) -> String;

    /// A number that parses to the same bits.
    fn number(&self, value: f64) -> String {
        format!("{value:?}")
    }
}

#[derive(Debug)]
pub(crate) struct Statements {
    pub(crate) lines: Vec<(String, String)>,
    pub(crate) outputs: Vec<String>,
    pub(crate) used: Vec<Input>,
}

#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Precedence {
    Sum,
    Product,
    Atom,
}

pub(crate) fn statements(graph: &Graph, outputs: &[Symbol], syntax: &dyn Syntax) -> Statements {
    let mut uses = vec![0_u32; graph.len()];
    for output in outputs {
        uses[output.id() as usize] += 1;
    }
    for id in (0..graph.len()).rev() {
        if uses[id] > 0 {
            graph.node(id as Id).parts().for_each(|part| uses[part as usize] += 1);
        }
    }
    let mut texts: Vec<Option<(String, Precedence)>> = vec![None; graph.len()];
    let (mut lines, mut used) = (Vec::new(), Vec::new());
    for id in 0..graph.len() {
        if uses[id] == 0 {
            continue;
        }
        let node = graph.node(id as Id);
        if let Node::Input(input, _) = node
            && !used.contains(&input)
        {
            used.push(input);
        }
        let (text, strength) = written(node, &texts, syntax);
        let is_leaf = matches!(node, Node::Constant(_) | Node::Input(..) | Node::Neg(_));
        texts[id] = Some(if is_leaf || uses[id] == 1 && text.len() <= MAX_INLINE_CHARACTERS {
            (text, strength)
        } else {
            let name = format!("x{}", lines.len() + 1);
            lines.push((name.clone(), text));
            (name, Precedence::Atom)
        });
    }
    let text = |id: Id| texts[id as usize].as_ref().map_or(String::new(), |(text, _)| text.clone());
    Statements { lines, outputs: outputs.iter().map(|output| text(output.id())).collect(), used }
}

/// Text of a node from the texts of its operands. Right operands keep their parentheses, so that the order of
/// summation is that of the graph.
fn written(node: Node, texts: &[Option<(String, Precedence)>], syntax: &dyn Syntax) -> (String, Precedence) {
    let part = |id: Id, least: Precedence| match &texts[id as usize] {
        Some((text, strength)) if *strength >= least => text.clone(),
        Some((text, _)) => format!("({text})"),
        None => String::new(),
    };
    let whole = |id: Id| part(id, Precedence::Sum);
    match node {
        Node::Constant(bits) => {
            let value = f64::from_bits(bits);
            (syntax.number(value), if value < 0.0 { Precedence::Sum } else { Precedence::Atom })
        }
        Node::Input(input, joint) => (syntax.input(input, joint as usize), Precedence::Atom),
        Node::Add(a, b) => (format!("{} + {}", whole(a), part(b, Precedence::Product)), Precedence::Sum),
        Node::Sub(a, b) => (format!("{} - {}", whole(a), part(b, Precedence::Product)), Precedence::Sum),
        Node::Mul(a, b) => {
            (format!("{} * {}", part(a, Precedence::Product), part(b, Precedence::Atom)), Precedence::Product)
        }
        Node::Neg(a) => (format!("-{}", part(a, Precedence::Atom)), Precedence::Sum),
        Node::Recip(a) => (format!("{} / {}", syntax.number(1.0), part(a, Precedence::Atom)), Precedence::Product),
        Node::Call(function, a) => (syntax.call(function, &whole(a)), Precedence::Atom),
        Node::Call2(function, a, b) => (syntax.call2(function, &whole(a), &whole(b)), Precedence::Atom),
        Node::Power(a, exponent) => (syntax.power(&whole(a), f64::from_bits(exponent)), Precedence::Atom),
        Node::Step(a, dead_band) => (syntax.step(&whole(a), f64::from_bits(dead_band)), Precedence::Atom),
    }
}
