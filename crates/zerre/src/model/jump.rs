//! Jump-Markov models: the way a target moves is itself a Markov chain (Blom and Bar-Shalom, IEEE Transactions on
//! Automatic Control 33(8), 1988).

use crate::error::{Error, Result};
use crate::math::Real;
use crate::time::{Span, Time};

/// Most modes of a [`JumpMarkov`]: what filters keep for each mode stands on the stack, so that no step allocates.
pub const MAX_MODES: usize = 16;

/// x_k = f_m(x_{k-1}, w_k), m = m_k a Markov chain: several motions over one state, one of them at work at a time.
///
/// The modes are of one type, so that kernels stay compiled for it: turns of different rates, motions with different
/// noise, or an enum of motions, such as [`Manoeuvre`](super::motion::Manoeuvre).
#[derive(Clone, Debug, PartialEq)]
pub struct JumpMarkov<A> {
    modes: Vec<A>,
    chain: Chain,
}

impl<A> JumpMarkov<A> {
    /// A model from its modes and the chain between them.
    ///
    /// # Errors
    /// No mode or more than [`MAX_MODES`]; a chain of another number of modes.
    pub fn new(modes: Vec<A>, chain: Chain) -> Result<Self> {
        if modes.len() != chain.len() {
            return Err(Error::Shape {
                what: "modes of the chain",
                found: chain.len(),
                expected: modes.len(),
            });
        }
        Ok(JumpMarkov { modes, chain })
    }

    /// The motions, in the order of the chain.
    pub fn modes(&self) -> &[A] {
        &self.modes
    }

    /// The chain between them.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }
}

/// A Markov chain over modes.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    initial: Vec<f64>,
    law: Law,
}

#[derive(Clone, Debug, PartialEq)]
enum Law {
    /// Rows of the transition matrix of any step.
    PerStep(Vec<Vec<f64>>),
    /// Rates of leaving each mode, per second; every other mode is as likely to follow.
    Sojourns(Vec<f64>),
}

impl Chain {
    /// `rows[i][j]` is the probability that mode `j` follows mode `i`, however long a step lasts. Modes are equally
    /// likely at the start.
    ///
    /// # Errors
    /// No mode or more than [`MAX_MODES`], rows that are not square, entries that are negative or not finite, a row whose
    /// sum differs from 1 by more than 1e-9.
    pub fn per_step(rows: Vec<Vec<f64>>) -> Result<Self> {
        let modes = count(rows.len())?;
        for row in &rows {
            law_of(row, modes, "row of the transition matrix")?;
        }
        Ok(Chain { initial: vec![1.0 / modes as f64; modes], law: Law::PerStep(rows) })
    }

    /// Each of `modes` stays with probability `stay` in a step; the others share the rest evenly.
    ///
    /// # Errors
    /// As [`Chain::per_step`].
    pub fn staying(modes: usize, stay: f64) -> Result<Self> {
        let modes = count(modes)?;
        let others = (modes - 1).max(1) as f64;
        let row = |i: usize| (0..modes).map(|j| if i == j { stay } else { (1.0 - stay) / others }).collect();
        Chain::per_step((0..modes).map(row).collect())
    }

    /// A chain in continuous time: mode `i` lasts `mean[i]` on average, exponentially distributed, and any of the others
    /// follows. The transition matrix is that of the time a step takes.
    ///
    /// # Errors
    /// No mode or more than [`MAX_MODES`]; a mean below a microsecond.
    pub fn sojourns(mean: &[Span]) -> Result<Self> {
        let modes = count(mean.len())?;
        let rates = mean
            .iter()
            .map(|&mean| {
                let mean = mean.secs();
                if mean >= 1e-6 {
                    Ok(1.0 / mean)
                } else {
                    let needs = "it must be a microsecond or longer";
                    Err(Error::OutOfRange { what: "mean time in a mode", value: mean, needs })
                }
            })
            .collect::<Result<_>>()?;
        Ok(Chain { initial: vec![1.0 / modes as f64; modes], law: Law::Sojourns(rates) })
    }

    /// The same chain with the law `initial` of the mode at the start.
    ///
    /// # Errors
    /// Another number of modes, entries that are negative or not finite, a sum that differs from 1 by more than 1e-9.
    pub fn with_initial(mut self, initial: &[f64]) -> Result<Self> {
        law_of(initial, self.len(), "law of the first mode")?;
        self.initial = initial.to_vec();
        Ok(self)
    }

    /// Number of modes.
    pub fn len(&self) -> usize {
        self.initial.len()
    }

    /// Never true: a chain has at least one mode.
    pub fn is_empty(&self) -> bool {
        self.initial.is_empty()
    }

    /// Law of the mode at the start.
    pub fn initial(&self) -> &[f64] {
        &self.initial
    }

    /// The transition from `from` to `to`; no time passes without change, so that two equal times give the identity.
    pub fn over(&self, from: Time, to: Time) -> Transition {
        let mut p = [[0.0; MAX_MODES]; MAX_MODES];
        let modes = self.len();
        match &self.law {
            _ if to <= from => {
                for i in 0..modes {
                    p[i][i] = 1.0;
                }
            }
            Law::PerStep(rows) => {
                for (p, row) in p.iter_mut().zip(rows) {
                    p[..modes].copy_from_slice(row);
                }
            }
            Law::Sojourns(rates) => uniformised(rates, (to - from).secs(), &mut p),
        }
        Transition { len: modes, p }
    }
}

/// exp(G dt) for the generator of a chain that leaves mode i at `rates[i]`, by uniformisation (Jensen 1953): with one clock
/// of rate r >= max rates, a Poisson number of jumps by I + G / r, whose entries are all positive. The time is halved
/// until few jumps are expected, and the result squared as often.
fn uniformised(rates: &[f64], dt: f64, p: &mut [[f64; MAX_MODES]; MAX_MODES]) {
    let modes = rates.len();
    let fastest = rates.iter().copied().fold(0.0, f64::max);
    let mut halvings = 0;
    let mut jumps = fastest * dt;
    // Beyond 2^60 expected jumps every row is the stationary law to all digits.
    while jumps > 0.5 && halvings < 60 {
        jumps *= 0.5;
        halvings += 1;
    }
    let jumps = jumps.min(0.5);
    let others = (modes - 1).max(1) as f64;
    let mut jump = [[0.0; MAX_MODES]; MAX_MODES];
    for i in 0..modes {
        let leave = if modes > 1 { rates[i] / fastest } else { 0.0 };
        for j in 0..modes {
            jump[i][j] = if i == j { 1.0 - leave } else { leave / others };
        }
    }
    // Below half a jump the terms fall faster than 2^-k / k!: twenty leave nothing.
    let mut term = [[0.0; MAX_MODES]; MAX_MODES];
    for i in 0..modes {
        term[i][i] = Real::exp(-jumps);
    }
    for i in 0..modes {
        p[i][..modes].copy_from_slice(&term[i][..modes]);
    }
    for k in 1..20 {
        term = product(&term, &jump, modes);
        for i in 0..modes {
            for j in 0..modes {
                term[i][j] *= jumps / f64::from(k);
                p[i][j] += term[i][j];
            }
        }
    }
    for _ in 0..halvings {
        *p = product(p, p, modes);
        // Sixty squarings would make a rounding error of a row's sum a large one.
        for row in p.iter_mut().take(modes) {
            let sum: f64 = row[..modes].iter().sum();
            row[..modes].iter_mut().for_each(|p| *p /= sum);
        }
    }
}

fn product(
    a: &[[f64; MAX_MODES]; MAX_MODES],
    b: &[[f64; MAX_MODES]; MAX_MODES],
    modes: usize,
) -> [[f64; MAX_MODES]; MAX_MODES] {
    let mut c = [[0.0; MAX_MODES]; MAX_MODES];
    for i in 0..modes {
        for j in 0..modes {
            c[i][j] = (0..modes).map(|k| a[i][k] * b[k][j]).sum();
        }
    }
    c
}

/// Probabilities of the modes after a step, for each mode before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    len: usize,
    p: [[f64; MAX_MODES]; MAX_MODES],
}

impl Transition {
    /// Number of modes.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Never true: there is at least one mode.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Probability that mode `to` follows mode `from`.
    ///
    /// # Panics
    /// If either is no mode.
    pub fn probability(&self, from: usize, to: usize) -> f64 {
        assert!(from < self.len && to < self.len, "no such mode");
        self.p[from][to]
    }

    /// Law of the mode after the step from that before it: c_j = sum over i of p_ij mu_i.
    ///
    /// # Panics
    /// If `law` has another number of modes.
    pub fn predict(&self, law: &[f64]) -> [f64; MAX_MODES] {
        assert!(law.len() == self.len, "a law of another number of modes");
        let mut after = [0.0; MAX_MODES];
        for (row, mass) in self.p.iter().zip(law) {
            for j in 0..self.len {
                after[j] += mass * row[j];
            }
        }
        after
    }
}

pub(crate) fn count(modes: usize) -> Result<usize> {
    if (1..=MAX_MODES).contains(&modes) {
        Ok(modes)
    } else {
        let needs = "it must lie between 1 and 16";
        Err(Error::OutOfRange { what: "number of modes", value: modes as f64, needs })
    }
}

pub(crate) fn law_of(law: &[f64], modes: usize, what: &'static str) -> Result<()> {
    if law.len() != modes {
        return Err(Error::Shape { what, found: law.len(), expected: modes });
    }
    for &p in law {
        Error::not_negative(what, p)?;
    }
    let sum: f64 = law.iter().sum();
    if (sum - 1.0).abs() <= 1e-9 {
        Ok(())
    } else {
        Err(Error::OutOfRange { what, value: sum, needs: "its probabilities must sum to 1" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn secs(s: f64) -> Time {
        Time::from_secs(s)
    }

    #[test]
    fn chains_refuse_what_is_no_law() {
        for rows in [
            vec![],
            vec![vec![1.0, 0.0]],
            vec![vec![0.5, 0.6], vec![0.5, 0.5]],
            vec![vec![1.5, -0.5], vec![0.5, 0.5]],
            vec![vec![f64::NAN, 1.0], vec![0.5, 0.5]],
            vec![vec![1.0 / 17.0; 17]; 17],
        ] {
            assert!(Chain::per_step(rows.clone()).is_err(), "{rows:?}");
        }
        assert!(Chain::staying(3, 1.1).is_err());
        assert!(Chain::sojourns(&[Span::ZERO]).is_err());
        let chain = Chain::staying(3, 0.9).unwrap();
        assert!(chain.clone().with_initial(&[0.5, 0.5]).is_err());
        assert!(JumpMarkov::new(vec![(); 2], chain).is_err());
    }

    #[test]
    fn no_time_changes_no_mode() {
        for chain in [Chain::staying(3, 0.7).unwrap(), Chain::sojourns(&[Span::from_secs(2.0); 3]).unwrap()] {
            let same = chain.over(secs(5.0), secs(5.0));
            assert_eq!(same.predict(&[0.2, 0.3, 0.5])[..3], [0.2, 0.3, 0.5]);
        }
    }

    /// With two modes the matrix is known in closed form: p_00 = (b + a e^(-(a+b) t)) / (a + b).
    #[test]
    fn sojourns_have_the_closed_form_of_two_modes() {
        for (first, second, dt) in [(2.0, 5.0, 0.1), (2.0, 5.0, 3.0), (0.5, 80.0, 40.0), (1.0, 1.0, 1e7)] {
            let chain = Chain::sojourns(&[Span::from_secs(first), Span::from_secs(second)]).unwrap();
            let step = chain.over(secs(0.0), secs(dt));
            let (a, b): (f64, f64) = (1.0 / first, 1.0 / second);
            let decay = (-(a + b) * dt).exp();
            let stay = (b + a * decay) / (a + b);
            // About log2(jumps) squarings, each of which doubles a relative error of some roundings.
            assert!((step.probability(0, 0) - stay).abs() < 1e-13, "{dt}");
            assert!((step.probability(0, 1) - (1.0 - stay)).abs() < 1e-13, "{dt}");
        }
    }

    /// Two half steps are one whole step, and every row stays a law.
    #[test]
    fn sojourns_compose() {
        let chain = Chain::sojourns(&[3.0, 7.0, 1.0, 20.0].map(Span::from_secs)).unwrap();
        let (half, whole) = (chain.over(secs(0.0), secs(1.7)), chain.over(secs(0.0), secs(3.4)));
        for i in 0..4 {
            let mut law = [0.0; 4];
            law[i] = 1.0;
            let first = half.predict(&law);
            let twice = half.predict(&first[..4]);
            let once = whole.predict(&law);
            for j in 0..4 {
                assert!((twice[j] - once[j]).abs() < 1e-14);
            }
            assert!((once.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        }
    }
}
