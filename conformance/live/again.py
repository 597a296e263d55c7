"""Stock that gets stuck by itself, seldom, is tried again."""


def tried(attempt, what, tries=3):
    """What `attempt` gives: a result, and why it is none. It is made again, so many times in all, until there is one."""
    for left in reversed(range(tries)):
        result, why = attempt()
        if why is None or left == 0:
            return result, why
        print("again", what, why, flush=True)
