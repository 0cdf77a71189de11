

def drawn(run, seed, decisions):
    """The numbers with which `evaluate` draws the actions of a seed's policy."""
    size = run.policy(seed).uniforms
    return draw_block(jnp.asarray([seed + FRESH], jnp.int32), "policy", 0, size)[:decisions, :, 0]


def test_drawn_actions_are_those_of_an_evaluation_too(tmp_path):
    run = learned("Pendulum")
    exported = read(run.policy(5).export(tmp_path / "policy.npz", only=["sample"]))["sample"]
    wanted = float(mg.evaluate(run, 12, mode="sample").reward[1])
    ways = {
        "act": lambda seen, numbers: run.act(seen, 5, numbers),
        "exported": lambda seen, numbers: exported(observation=seen, uniforms=numbers)["action"],
    }
    for name, act in ways.items():
        numbers = iter(np.asarray(drawn(run, 5, 12)))
        np.testing.assert_allclose(
            earned("Pendulum", lambda seen, act=act, numbers=numbers: act(seen, next(numbers)))[0], wanted, rtol=2e-5, err_msg=name
        )


@needs_compiler
@pytest.mark.parametrize("name", ["Pendulum", "CartPole", "arm"])
def test_c_source_takes_raw_observations_and_says_what_they_are(name, tmp_path):
    run = learned(name)
    policy = run.policy(5)
    call = CompiledC(programs({"mode": functions(policy)["mode"]}), tmp_path)
    observation = np.asarray(begun(name, 5)[1])
    found = call("mode", {"observation": observation})["action"]
    np.testing.assert_allclose(found, run.act(observation, 5), rtol=1e-5, atol=1e-7)
    text = policy.export(tmp_path / "own.c", only=["mode"]).read_text()
    for place, seen in enumerate(policy.interface.observations.names):
        assert f"[{place}] {seen}\n" in text


@pytest.mark.needs("motorgrad[onnx]")
@pytest.mark.parametrize("name", ["Pendulum", "CartPole", "arm"])
def test_an_onnx_model_takes_raw_observations_and_says_what_they_are(name, tmp_path):
    import onnx
    import onnxruntime

    run = learned(name)
    path = run.policy(5).export(tmp_path / "policy.onnx", only=["mode"])
    observation = np.asarray(begun(name, 5)[1], np.float32)
    found = onnxruntime.InferenceSession(path).run(["mode"], {"observation": observation})[0]
    np.testing.assert_allclose(found, run.act(observation, 5), rtol=1e-5, atol=1e-7)
    told = {each.key: each.value for each in onnx.load(path).metadata_props}
    assert Interface.of_table(json.loads(told["interface"])).observations == run.policies.interface.observations


def test_many_observations_are_acted_on_at_once():
    run = learned("arm")
    observations = np.random.default_rng(1).normal(size=(2, 3, 7))
    found = run.act(observations)
    assert found.shape == (2, 3, 6)
    np.testing.assert_allclose(found[1, 2], run.act(observations[1, 2]), rtol=1e-6)
    assert learned("CartPole").act(np.zeros((3, 4))).shape == (3,)
    with pytest.raises(ValueError, match=r"observation\.shape = \(6,\): must be \(7,\), after any axes"):
        run.act(np.zeros(6))
    with pytest.raises(ValueError, match=r"observation = .*nan.* must be finite numbers"):
        run.act(np.full(7, np.nan))


def test_a_policy_with_a_memory_acts_by_an_actor_that_keeps_it():
    run = mg.train("t-maze", steps=200, progress=False)
    with pytest.raises(ValueError, match=r"without a memory; run\.actor\(seed\) keeps it"):
        run.act(np.zeros(run.task.observation_size))
    policy, actor = run.policy(), run.actor()
    memory, rng = policy.initial_memory(), np.random.default_rng(0)
    for _ in range(6):
        observation, uniforms = rng.random(policy.observation_size), jnp.asarray(rng.random(policy.uniforms))
        seen = policy.perceive(memory, jnp.asarray(observation, jnp.float32))
        action = policy.sample(seen, uniforms)
        memory = policy.remember(seen, action)
        np.testing.assert_array_equal(actor.act(observation, uniforms), policy.emit(action))
    before = np.asarray(actor.memory)
    actor.reset()
    assert not np.array_equal(actor.memory, before)


def test_a_policy_that_belongs_to_no_task_is_refused_by_name():
    with pytest.raises(ValueError, match=r"Hyperplanes without an interface: must be one of a run, run\.policy\(seed\)"):
        mg.policies.hyperplanes(mg.make("hopper")).act(np.zeros(3))


# -- continuing


def test_a_training_that_starts_from_a_run_goes_on_with_its_statistics(tmp_path):
    run = learned("arm")
    counts = np.asarray(run.policies.interface.statistics.mean.count)
    again = mg.train(run.task, run_agent("arm"), 8, [3, 5], tmp_path, window=8, progress=False, initial=run.policies)
    np.testing.assert_array_equal(again.initial.interface.statistics.mean.count, counts)
    np.testing.assert_array_equal(again.policies.interface.statistics.mean.count, counts + 9)  # and the first look
    assert_same(mg.load(tmp_path).initial.interface, again.initial.interface)
    assert_same(mg.load(tmp_path).policies, again.policies)
    assert_same(mg.training.given_initial(tmp_path), jax.tree.map(np.asarray, run.policies))


def test_what_starts_from_a_run_starts_at_its_level():
    """A step size of nearly 0 shows the level: it is that of the run evaluated, and another without the statistics."""
    run = learned("arm")
    agent = mg.Agent(run_agent("arm").policy, mg.learning.olgarb(decay=0.9), mg.learning.SGD(1e-12))
    more = {"steps": 40, "window": 40, "progress": False, "seeds": [3, 5]}
    level = mg.train(run.task, agent, initial=run, **more).final()
    alone = mg.train(run.task, agent, initial=with_interface(run.policies, None), **more).final()
    frozen = mg.train(run.task, mg.Agent(agent.policy, FROZEN), initial=run, **more).final()
    np.testing.assert_allclose(level, frozen, rtol=0.02)
    assert np.abs(alone - frozen).max() > 0.05 * np.abs(frozen).max()
