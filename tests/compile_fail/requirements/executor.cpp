// SPDX-License-Identifier: MIT
// wrong: Executor: must have a copy constructor
// wrong: Executor: executor(Index count, const Task& task) const must take any task that is called with an Index
#include <membrane/core/executor.hpp>

struct Pool {
    Pool();
#if WRONG == 1
    Pool(const Pool&) = delete;
#endif
    template <class Task>
    void operator()(membrane::Index count, const Task& task)
#if WRONG != 2
        const
#endif
        ;
};

static_assert(membrane::CheckedExecutor<Pool>);
