# The types with which Cython compiles headers.py. Plain Python never reads this file.
cimport cython

cdef bint _COMPILED
cdef unsigned int _UDP, _READ, _WRITE
cdef unsigned int _READ_REQUEST, _READ_RESPONSE, _WRITE_REQUEST, _WRITE_RESPONSE
cdef Py_ssize_t _BODY, _DATA, _UDP_START, _BLOCK_END, _SECOND_BLOCK

cdef unsigned int _u16(const unsigned char* data, Py_ssize_t at) noexcept nogil

cdef unsigned int _word(const unsigned char* data, Py_ssize_t at, bint little) noexcept nogil

cpdef object datagram_key(object conversation, unsigned int ip_id, unsigned int fragment, unsigned int seq, bytes body)

cdef class Headers:
    cdef object _conversation
    cdef bytes _front, _hosts
    cdef unsigned int _read_kind, _write_kind
    cdef bint _request, _little

    @cython.locals(view="const unsigned char*", front="const unsigned char*", hosts="const unsigned char*",
                   size=Py_ssize_t, at=Py_ssize_t, udp=Py_ssize_t, length=Py_ssize_t, end=Py_ssize_t,
                   stated=Py_ssize_t, opnum="unsigned int", kind="unsigned int", seq="unsigned int", fits=bint)
    cdef tuple _compiled(self, bytes data)
