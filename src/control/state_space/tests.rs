use super::*;
use crate::control::matrix;
use crate::control::matrix::{
    apply, difference, dot, identity, largest, narrow, row_sum, solved, times, times_transposed,
    transposed, wide,
};
use crate::error::ConfigError;
use proptest::prelude::*;

const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

fn double_integrator(dt_s: f32) -> LinearSystem<2, 1> {
    LinearSystem::discretized(&[[0.0, 1.0], [0.0, 0.0]], &[[0.0], [1.0]], dt_s).unwrap()
}

fn quadratic<const N: usize>(x: &[f32; N], cost: &[[f32; N]; N]) -> f32 {
    dot(x, &apply(cost, x))
}

/// Matrices with entries up to 1, unstable for half of the draws.
fn matrices<const R: usize, const C: usize>() -> impl Strategy<Value = [[f32; C]; R]> {
    prop::array::uniform(prop::array::uniform(-1.0_f32..1.0))
}

/// Costs and covariances.
fn positive<const N: usize>() -> impl Strategy<Value = [[f32; N]; N]> {
    matrices::<N, N>().prop_map(|root| {
        let square = times_transposed(&root, &root);
        matrix::symmetric(&matrix::with_diagonal(square, 0.05))
    })
}

fn near<const R: usize, const C: usize>(
    a: &[[f32; C]; R],
    b: &[[f32; C]; R],
    relative: f32,
) -> bool {
    largest(&difference(a, b)) <= relative * (largest(a).max(largest(b)) + f32::MIN_POSITIVE)
}

#[test]
fn a_rotation_of_a_quarter_turn_is_exact_to_f32_also_after_a_hundred_turns() {
    for turns in [0.25_f32, 1.25, 100.25] {
        let way = turns * core::f32::consts::TAU;
        let plant = LinearSystem::discretized(&[[0.0, way], [-way, 0.0]], &[[0.0], [1.0]], 1.0);
        let error = 1e-7 * way; // of the angle, which is no f32
        assert!(near(plant.unwrap().a(), &[[0.0, 1.0], [-1.0, 0.0]], error + 1e-7), "{turns}");
    }
}

#[test]
fn the_first_order_lag_is_the_one_of_a_textbook() {
    // x' = (u - x) / 2 s, over 1 s.
    let lag = LinearSystem::discretized(&[[-0.5]], &[[0.5]], 1.0).unwrap();
    assert!(near(lag.a(), &[[0.606_530_66]], 1e-7) && near(lag.b(), &[[0.393_469_34]], 1e-7));
}

#[test]
fn the_scalar_equation_has_the_solution_of_the_quadratic_formula() {
    for (a, b, q, r) in
        [(1.0, 1.0, 1.0, 1.0), (2.0, 0.5, 3.0, 0.1), (0.5, 1.0, 1.0, 1e6), (1.001, 1e-3, 1e-6, 1e3)]
    {
        let plant = LinearSystem::discrete(&[[a]], &[[b]]).unwrap();
        let regulator = LinearQuadraticRegulator::new(&plant, &[[q]], &[[r]]).unwrap();
        let [a, b, q, r] = [a, b, q, r].map(f64::from);
        // b² X² + (r - a² r - b² q) X - q r = 0
        let half = (r - a * a * r - b * b * q) / 2.0;
        let cost = (-half + (half * half + b * b * q * r).sqrt()) / (b * b);
        let gain = b * cost * a / (r + b * b * cost);
        let found = f64::from(regulator.gain()[0][0]);
        assert!((found / gain - 1.0).abs() < 1e-6, "{a}: {found}, not {gain}");
    }
}

#[test]
fn a_plant_that_no_gain_stabilises_is_refused_and_names_the_matrix() {
    let one = diagonal(&[1.0]);
    let both = diagonal(&[1.0, 1.0]);
    let refused = |a: [[f32; 2]; 2], b: [[f32; 1]; 2], q: [[f32; 2]; 2]| {
        let plant = LinearSystem::discrete(&a, &b).unwrap();
        LinearQuadraticRegulator::new(&plant, &q, &one).err()
    };
    let unstable = diagonal(&[0.5, 1.5]);
    let reason = Some(ConfigError::NotStabilizable("b"));
    assert_eq!(refused(unstable, [[1.0], [0.0]], both), reason, "not reached");
    assert_eq!(refused(diagonal(&[0.5, 1.0]), [[1.0], [0.0]], both), reason, "not reached");
    assert_eq!(
        refused(diagonal(&[0.5, 1.0]), [[1.0], [1.0]], diagonal(&[1.0, 0.0])),
        reason,
        "no cost"
    );
    assert_eq!(refused(unstable, [[0.0], [1.0]], both), None);
    // A mode that decays needs no input.
    assert_eq!(refused(diagonal(&[0.5, 0.9]), [[1.0], [0.0]], both), None);

    let plant = LinearSystem::discrete(&unstable, &[[1.0], [1.0]]).unwrap();
    let blind = KalmanFilter::new(&plant, &[[1.0, 0.0]], &both, &one);
    assert_eq!(blind.err(), Some(ConfigError::NotStabilizable("c")));
    let blind = LuenbergerObserver::steady_state(&plant, &[[1.0, 0.0]], &both, &one);
    assert_eq!(blind.err(), Some(ConfigError::NotStabilizable("c")));
    let gain = [[0.5], [0.5]];
    let blind = LuenbergerObserver::new(&plant, &[[1.0, 0.0]], &gain);
    assert_eq!(blind.err(), Some(ConfigError::Unstable("gain")));
}

#[test]
fn an_entry_that_is_not_finite_names_its_matrix() {
    let (a, b, c) = ([[1.0, 0.1], [0.0, 1.0]], [[0.0], [0.1]], [[1.0, 0.0]]);
    let (q, r) = (diagonal(&[1.0, 1.0]), diagonal(&[1.0]));
    let plant = LinearSystem::discrete(&a, &b).unwrap();
    for bad in BAD {
        let wrong = [[1.0, bad], [bad, 1.0]];
        let named = |parameter| Some(ConfigError::NotFinite(parameter));
        assert_eq!(LinearSystem::discrete(&wrong, &b).err(), named("a"));
        assert_eq!(LinearSystem::discrete(&a, &[[0.0], [bad]]).err(), named("b"));
        assert_eq!(LinearSystem::discretized(&wrong, &b, 0.1).err(), named("a"));
        assert_eq!(LinearSystem::discretized(&a, &[[bad], [0.0]], 0.1).err(), named("b"));
        let time = LinearSystem::discretized(&a, &b, bad).err();
        assert_eq!(time, Some(ConfigError::NotPositive("dt_s")));
        assert_eq!(LinearQuadraticRegulator::new(&plant, &wrong, &r).err(), named("q"));
        assert_eq!(LinearQuadraticRegulator::new(&plant, &q, &[[bad]]).err(), named("r"));
        assert_eq!(LinearQuadraticRegulator::from_gain(&[[0.0, bad]]).err(), named("gain"));
        let regulator = LinearQuadraticRegulator::<2, 1>::from_gain(&[[1.0, 1.0]]).unwrap();
        let limit = regulator.with_output_limit(&[bad]).err();
        assert_eq!(limit, Some(ConfigError::NotPositive("output_limit")));
        assert_eq!(KalmanFilter::new(&plant, &[[bad, 0.0]], &q, &r).err(), named("c"));
        assert_eq!(KalmanFilter::new(&plant, &c, &wrong, &r).err(), named("q"));
        assert_eq!(KalmanFilter::new(&plant, &c, &q, &[[bad]]).err(), named("r"));
        let filter = KalmanFilter::new(&plant, &c, &q, &r).unwrap();
        assert_eq!(filter.with_start(&[bad, 0.0], &q).err(), named("state"));
        assert_eq!(filter.with_start(&[0.0, 0.0], &wrong).err(), named("covariance"));
        assert_eq!(
            LuenbergerObserver::new(&plant, &[[bad, 0.0]], &[[0.5], [0.5]]).err(),
            named("c")
        );
        assert_eq!(LuenbergerObserver::new(&plant, &c, &[[bad], [0.5]]).err(), named("gain"));
        let observer = LuenbergerObserver::new(&plant, &c, &[[0.5], [0.5]]).unwrap();
        assert_eq!(observer.with_state(&[0.0, bad]).err(), named("state"));
        assert_eq!(GainSchedule::new([(bad, [[1.0]])]).err(), named("parameter"));
        assert_eq!(GainSchedule::new([(0.0, [[bad]])]).err(), named("gain"));
    }
}

#[test]
fn costs_that_are_not_symmetric_or_negative_and_singular_inputs_are_refused() {
    let plant = double_integrator(0.01);
    let refused = |q, r| LinearQuadraticRegulator::new(&plant, &q, &[[r]]).err();
    assert_eq!(refused([[1.0, 0.1], [0.0, 1.0]], 1.0), Some(ConfigError::Unusable("q")));
    assert_eq!(refused(diagonal(&[1.0, -0.1]), 1.0), Some(ConfigError::Negative("q")));
    assert_eq!(refused([[1.0, 2.0], [2.0, 1.0]], 1.0), Some(ConfigError::Negative("q")));
    assert_eq!(refused([[0.0, 1.0], [1.0, 0.0]], 1.0), Some(ConfigError::Negative("q")));
    for r in [0.0, -1.0] {
        assert_eq!(refused(identity(), r), Some(ConfigError::NotPositive("r")));
    }
    let filter = KalmanFilter::new(&plant, &[[1.0, 0.0]], &identity(), &identity()).unwrap();
    let negative = filter.with_start(&[0.0, 0.0], &diagonal(&[1.0, -1.0])).err();
    assert_eq!(negative, Some(ConfigError::Negative("covariance")));

    let inverted = |b| LinearSystem::<2, 2>::discrete(&identity(), &b).unwrap().input_inverse();
    assert_eq!(inverted([[1.0, 2.0], [2.0, 4.0]]).err(), Some(ConfigError::Singular("b")));
    assert_eq!(inverted([[1.0, 0.0], [2.0, 0.0]]).err(), Some(ConfigError::Singular("b")));
    // Of one state, two inputs cannot be told.
    let two = LinearSystem::discrete(&[[1.0]], &[[1.0, 2.0]]).unwrap();
    assert_eq!(two.input_inverse().err(), Some(ConfigError::Singular("b")));

    let table = [(1.0, [[1.0]]), (1.0, [[2.0]])];
    assert_eq!(GainSchedule::new(table).err(), Some(ConfigError::Reversed("parameter")));
    assert_eq!(GainSchedule::<1, 1, 0>::new([]).err(), Some(ConfigError::Unusable("table")));
}

#[test]
fn a_mode_that_grows_beyond_f32_in_a_step_is_refused_and_one_that_decays_is_not() {
    let fast = |rate| LinearSystem::discretized(&[[rate]], &[[1.0]], 1.0);
    assert_eq!(fast(100.0).err(), Some(ConfigError::OutOfRange("dt_s")));
    assert_eq!(fast(f32::MAX).err(), Some(ConfigError::OutOfRange("dt_s")));
    assert!(near(fast(-80.0).unwrap().b(), &[[1.0 / 80.0]], 1e-6));
}

#[test]
fn a_bad_state_returns_the_last_output_and_the_limit_holds() {
    let mut regulator = LinearQuadraticRegulator::<2, 1>::from_gain(&[[3.0, 1.0]])
        .unwrap()
        .with_output_limit(&[5.0])
        .unwrap();
    assert_eq!(regulator.step(&[1.0, 0.0], &[0.0, 1.0]), [2.0]);
    for bad in BAD {
        assert_eq!(regulator.step(&[1.0, 0.0], &[bad, 1.0]), [2.0]);
        assert_eq!(regulator.step(&[1.0, bad], &[0.0, 1.0]), [2.0]);
        regulator.set_gain(&[[bad, 0.0]]);
    }
    assert_eq!(regulator.rejected(), 9);
    assert_eq!(regulator.step(&[-9.0, 0.0], &[0.0, 0.0]), [-5.0]);
    // A difference beyond f32 is no state either.
    assert_eq!(regulator.step(&[f32::MAX, 0.0], &[f32::MIN, 0.0]), [-5.0]);
}

#[test]
fn the_filter_of_a_chain_of_six_integrators_stays_positive_for_20_s_at_1_khz() {
    let mut a = [[0.0; 6]; 6];
    for (row, entries) in a.iter_mut().enumerate().take(5) {
        entries[row + 1] = 1.0;
    }
    let mut b = [[0.0]; 6];
    b[5] = [1.0];
    let plant = LinearSystem::discretized(&a, &b, 0.001).unwrap();
    let c = [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
    let q = diagonal(&[1e-8, 1e-8, 1e-8, 1e-6, 1e-6, 1e-4]);
    let mut filter = KalmanFilter::new(&plant, &c, &q, &[[1e-4]]).unwrap();
    for _ in 0..20_000 {
        filter.predict(&[0.0]);
        filter.correct(&[1.0]);
    }
    assert_eq!(filter.rejected(), 0);
    assert_eq!(matrix::not_negative("covariance", &filter.covariance()), Ok(()));
    assert!((filter.state()[0] - 1.0).abs() < 0.01, "{:?}", filter.state());
}

#[test]
fn the_steady_observer_keeps_up_with_the_filter_where_the_gains_nearly_cancel() {
    // Four integrators in a row at 200 Hz, of which the last is measured.
    let mut rates = [[0.0; 4]; 4];
    for (row, entries) in rates.iter_mut().enumerate().take(3) {
        entries[row + 1] = 1.0;
    }
    let plant = LinearSystem::discretized(&rates, &[[0.0], [0.0], [0.0], [1.0]], 0.005).unwrap();
    let (c, q, r) = ([[1.0, 0.0, 0.0, 0.0]], diagonal(&[1e-6, 1e-4, 1e-2, 1.0]), [[1e-6]]);
    let mut observer = LuenbergerObserver::steady_state(&plant, &c, &q, &r).unwrap();
    let mut filter = KalmanFilter::new(&plant, &c, &q, &r).unwrap();
    for _ in 0..1_000 {
        filter.predict(&[0.0]);
        filter.correct(&[0.0]);
    }
    for step in 0..1_000_u16 {
        let (u, y) = ([f32::from(step % 7) - 3.0], [f32::from(step % 5) - 2.0]);
        filter.predict(&u);
        filter.correct(&y);
        observer.predict(&u);
        observer.correct(&y);
        assert!(
            near(&[observer.state()], &[filter.state()], 1e-6),
            "{:?} {:?}",
            observer.state(),
            filter.state()
        );
    }
}

proptest! {
    #[test]
    fn the_regulator_stabilises_and_no_gain_near_it_costs_less(
        a in matrices::<4, 4>(), b in matrices::<4, 2>(), q in positive::<4>(), r in positive::<2>(),
        change in matrices::<2, 4>(), x in prop::array::uniform4(-1.0_f32..1.0),
    ) {
        let plant = LinearSystem::discrete(&a, &b).unwrap();
        let solution = riccati::regulator(&plant, &q, &r).unwrap();
        let (gain, cost) = (narrow(&solution.gain).unwrap(), narrow(&solution.cost).unwrap());
        prop_assert!(riccati::decays(&difference(&a, &times(&b, &gain))));
        // Bellman: the cost to go falls by what the step costs.
        let u = apply(&gain, &x).map(|u| -u);
        let next = plant.predict(&x, &u);
        let now = quadratic(&x, &q) + quadratic(&u, &r);
        let (before, after) = (quadratic(&x, &cost), quadratic(&next, &cost));
        prop_assert!((before - now - after).abs() <= 1e-4 * (before + now + after), "{before} {now} {after}");
        prop_assert!(after < before);
        let other: [f32; 2] = core::array::from_fn(|input| u[input] + 0.1 * dot(&change[input], &x));
        let worse = quadratic(&x, &q) + quadratic(&other, &r) + quadratic(&plant.predict(&x, &other), &cost);
        prop_assert!(worse >= before * (1.0 - 1e-4));
    }

    #[test]
    fn the_filter_is_the_regulator_of_the_transposed_plant(
        a in matrices::<3, 3>(), c in matrices::<2, 3>(), q in positive::<3>(), r in positive::<2>(),
    ) {
        let plant = LinearSystem::discrete(&a, &[[0.0]; 3]).unwrap();
        let observer = LuenbergerObserver::steady_state(&plant, &c, &q, &r).unwrap();
        let dual = LinearSystem::discrete(&transposed(&a), &transposed(&c)).unwrap();
        let regulator = LinearQuadraticRegulator::new(&dual, &q, &r).unwrap();
        let predictor = times(&a, &observer.gain());
        prop_assert!(near(&predictor, &transposed(regulator.gain()), 1e-5));
        prop_assert!(LuenbergerObserver::new(&plant, &c, &observer.gain()).is_ok());
    }

    #[test]
    fn the_covariance_settles_where_the_steady_filter_is(
        a in matrices::<3, 3>(), c in matrices::<1, 3>(), q in positive::<3>(), start in positive::<3>(),
    ) {
        let plant = LinearSystem::discrete(&a, &[[0.0]; 3]).unwrap();
        let (steady, _) = riccati::filter(&plant, &c, &q, &[[1.0]]).unwrap();
        let mut filter = KalmanFilter::new(&plant, &c, &q, &[[1.0]]).unwrap().with_start(&[0.0; 3], &start).unwrap();
        for _ in 0..3_000 {
            filter.predict(&[0.0]);
            filter.correct(&[0.0]);
        }
        filter.predict(&[0.0]);
        let steady = narrow(&steady).unwrap();
        // A correction cancels most of a large covariance, and the next ones take back as little of its rounding.
        let rounding = 2e-7 * largest(&steady) * largest(&steady);
        prop_assert!(near(&filter.covariance(), &steady, 1e-4 + rounding), "{:?} {steady:?}", filter.covariance());
    }

    #[test]
    fn two_steps_are_one_of_twice_the_time(a in matrices::<3, 3>(), b in matrices::<3, 2>(), dt_s in 1e-3_f32..2.0) {
        let one = LinearSystem::discretized(&a, &b, dt_s).unwrap();
        let two = LinearSystem::discretized(&a, &b, 2.0 * dt_s).unwrap();
        prop_assert!(near(&times(one.a(), one.a()), two.a(), 2e-6));
        let of_input = matrix::sum(&times(one.a(), one.b()), one.b());
        prop_assert!(near(&of_input, two.b(), 2e-6));
    }

    #[test]
    fn the_inverted_plant_reaches_what_can_be_reached(
        a in matrices::<4, 4>(), b in matrices::<4, 2>(), x in prop::array::uniform4(-1.0_f32..1.0),
        u in prop::array::uniform2(-1.0_f32..1.0),
    ) {
        let normal = times(&transposed(&b), &b);
        prop_assume!(solved(&wide(&normal), &identity()).is_some_and(|inverse| row_sum(&inverse) < 20.0));
        let plant = LinearSystem::discrete(&a, &b).unwrap();
        let effort = plant.effort(&plant.input_inverse().unwrap(), &x, &plant.predict(&x, &u));
        prop_assert!(near(&[effort], &[u], 1e-4) || largest(&[u]) < 1e-2, "{effort:?} {u:?}");
    }

    #[test]
    fn the_schedule_is_its_rows_between_its_rows_and_its_ends_beyond(
        parameter in any::<f32>(), lower in -10.0_f32..10.0, upper in -10.0_f32..10.0,
    ) {
        let schedule = GainSchedule::new([(-2.0, [[lower]]), (1.0, [[upper]]), (3.0, [[lower]])]).unwrap();
        prop_assert_eq!(schedule.gain(-2.0), Some([[lower]]));
        prop_assert_eq!(schedule.gain(1.0), Some([[upper]]));
        prop_assert_eq!(schedule.gain(f32::INFINITY), Some([[lower]]));
        prop_assert_eq!(schedule.gain(f32::NEG_INFINITY), Some([[lower]]));
        prop_assert_eq!(scheduled_gain(&[(1.0, [[lower]]), (1.0, [[upper]])], 2.0), Some([[upper]]));
        prop_assert_eq!(scheduled_gain(&[(2.0, [[lower]]), (1.0, [[upper]])], 0.0), Some([[lower]]));
        prop_assert_eq!(scheduled_gain::<1, 1>(&[(f32::NAN, [[lower]]), (1.0, [[upper]])], 0.0), None);
        match schedule.gain(parameter) {
            Some([[gain]]) => prop_assert!(gain >= lower.min(upper) - 1e-5 && gain <= lower.max(upper) + 1e-5),
            None => prop_assert!(parameter.is_nan()),
        }
    }

    #[test]
    fn whatever_comes_is_solved_or_refused_and_stays_finite(
        a in prop::array::uniform3(prop::array::uniform3(any::<f32>())), b in prop::array::uniform3([any::<f32>()]),
        scale in prop::sample::select(&[1e-30_f32, 1e-15, 1e-5, 1.0, 1e5, 1e15, 1e30][..]), q in positive::<3>(),
        r in 1e-30_f32..1e30, dt_s in any::<f32>(), signals in prop::collection::vec((any::<f32>(), any::<f32>()), 1..20),
    ) {
        let q = q.map(|row| row.map(|entry| entry * scale));
        for plant in [LinearSystem::discrete(&a, &b), LinearSystem::discretized(&a, &b, dt_s)].into_iter().flatten() {
            let c = [[1.0, 0.0, 0.0]];
            let regulator = LinearQuadraticRegulator::new(&plant, &q, &[[r]]);
            if let Ok(mut regulator) = regulator {
                prop_assert!(matrix::is_finite(regulator.gain()));
                for (one, two) in &signals {
                    prop_assert!(regulator.step(&[*one; 3], &[*two; 3])[0].is_finite());
                }
            }
            if let Ok(mut filter) = KalmanFilter::new(&plant, &c, &q, &[[r]]) {
                for (input, measured) in &signals {
                    filter.predict(&[*input]);
                    filter.correct(&[*measured]);
                    prop_assert!(matrix::is_finite(&[filter.state()]) && matrix::is_finite(&filter.covariance()));
                }
            }
            if let Ok(inverse) = plant.input_inverse() {
                for (one, two) in &signals {
                    prop_assert!(plant.effort(&inverse, &[1.0; 3], &[*one; 3])[0].is_finite() || two.is_nan() || one.is_nan());
                }
            }
        }
    }
}
